// Tables of text: a heading, then rows, with tabs between cells.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace planish::testing {

using Row = std::map<std::string, std::string>;  // from heading to cell

// Nothing if there is no such file.
inline std::vector<Row> ReadTable(const std::filesystem::path& path) {
  std::ifstream file(path);
  const auto cells = [](const std::string& line) {
    std::vector<std::string> result;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, '\t');) result.push_back(cell);
    return result;
  };
  std::string line;
  std::getline(file, line);
  const std::vector<std::string> heading = cells(line);
  std::vector<Row> rows;
  while (std::getline(file, line)) {
    const std::vector<std::string> row = cells(line);
    for (std::size_t i = 0; i < std::min(row.size(), heading.size()); ++i) {
      if (i == 0) rows.emplace_back();
      rows.back()[heading[i]] = row[i];
    }
  }
  return rows;
}

}  // namespace planish::testing
