#include "tests/bench/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace planish::bench {

Runs Where(const Runs& runs, const std::string& field, const nlohmann::json& value) {
  Runs found;
  for (const auto& run : runs) {
    if (run.contains(field) && run[field] == value) found.push_back(run);
  }
  return found;
}

std::vector<nlohmann::json> Values(const Runs& runs, const std::string& field) {
  std::vector<nlohmann::json> values;
  for (const auto& run : runs) {
    if (run.contains(field) && std::find(values.begin(), values.end(), run[field]) == values.end()) {
      values.push_back(run[field]);
    }
  }
  return values;
}

std::vector<double> Numbers(const Runs& runs, const std::string& field) {
  std::vector<double> numbers;
  for (const auto& run : runs) {
    if (run.contains(field) && run[field].is_number()) numbers.push_back(run[field]);
  }
  return numbers;
}

std::vector<Runs> ByMesh(const Runs& runs) {
  std::vector<Runs> meshes;
  for (const auto& label : Values(runs, "mesh")) {
    const Runs same = Where(runs, "mesh", label);
    for (const auto& triangles : Values(same, "triangles")) meshes.push_back(Where(same, "triangles", triangles));
  }
  return meshes;
}

std::vector<double> Ratios(const Runs& mesh, const std::string& tool, const std::string& field,
                           const std::string& own_tool, const std::string& own_field) {
  std::vector<double> ratios;
  for (const auto& round : Values(mesh, "round")) {
    const Runs now = Where(mesh, "round", round);
    const std::vector<double> ours = Numbers(Where(now, "tool", own_tool), own_field);
    const std::vector<double> theirs = Numbers(Where(now, "tool", tool), field);
    if (!ours.empty() && !theirs.empty()) ratios.push_back(theirs[0] / ours[0]);
  }
  return ratios;
}

double Median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

double GeometricMean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += std::log(value);
  return std::exp(sum / static_cast<double>(values.size()));
}

std::string WithCommas(std::int64_t value) {
  std::string digits = std::to_string(value);
  for (auto at = static_cast<std::int64_t>(digits.size()) - 3; at > 0; at -= 3) digits.insert(at, ",");
  return digits;
}

std::string ThreeDigits(double value) {
  if (!std::isfinite(value)) return "-";
  if (std::abs(value) >= 1000) return WithCommas(std::llround(value));
  const int before = value == 0 ? 1 : static_cast<int>(std::floor(std::log10(std::abs(value)))) + 1;
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", std::clamp(3 - before, 0, 6), value);
  return text;
}

std::string Row(const std::vector<std::string>& cells) {
  std::string row = "|";
  for (const std::string& cell : cells) row += " " + cell + " |";
  return row + "\n";
}

std::string HeaderRow(const std::vector<std::string>& cells) {
  std::string line = "|---|";
  for (std::size_t i = 1; i < cells.size(); ++i) line += "--:|";
  return Row(cells) + line + "\n";
}

void WriteText(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path);
}

}  // namespace planish::bench
