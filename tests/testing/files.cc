#include "tests/testing/files.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace planish {

namespace fs = std::filesystem;

TempDir::TempDir() {
  std::string pattern = (fs::temp_directory_path() / "planish-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make " + pattern);
  path_ = pattern;
}

TempDir::~TempDir() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::string ReadFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return std::move(bytes).str();
}

void PutFile(const fs::path& path, std::string_view bytes, bool append) {
  std::ofstream file(path, append ? std::ios::binary | std::ios::app : std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

void ReplaceFile(const fs::path& path, std::string_view bytes, int mode) {
  const fs::path next = path.string() + ".new";
  PutFile(next, bytes);
  fs::permissions(next, static_cast<fs::perms>(mode));
  fs::rename(next, path);
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::vector<TableRow> ReadTable(const fs::path& path) {
  const auto cells = [](const std::string& line) {
    std::vector<std::string> result;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, '\t');) result.push_back(cell);
    return result;
  };
  std::vector<TableRow> rows;
  std::vector<std::string> heading;
  for (const std::string& line : fs::exists(path) ? Lines(ReadFile(path)) : std::vector<std::string>()) {
    const std::vector<std::string> row = cells(line);
    if (heading.empty()) {
      heading = row;
      continue;
    }
    for (std::size_t i = 0; i < std::min(row.size(), heading.size()); ++i) {
      if (i == 0) rows.emplace_back();
      rows.back()[heading[i]] = row[i];
    }
  }
  return rows;
}

}  // namespace planish
