// Runs of the measuring programs, one JSON object a line, made into Markdown tables and columns for gnuplot.
#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

namespace planish::bench {

using Runs = std::vector<nlohmann::json>;

// Each takes the runs of one bench, returns the text of its .md file and writes the columns that its .gp file reads to
// files whose names start with `columns`.
std::string ReportPaper(const Runs& runs, const std::string& columns);
std::string ReportScale(const Runs& runs, const std::string& columns);
std::string ReportPeers(const Runs& runs, const std::string& columns);
std::string ReportAtlas(const Runs& runs, const std::string& columns);
std::string ReportMemory(const Runs& runs, const std::string& columns);
std::string ReportService(const Runs& runs, const std::string& columns);
std::string ReportTuning(const Runs& runs);
std::string ReportFarm(const Runs& runs);  // has no plot

// The runs whose `field` is `value`.
Runs Where(const Runs& runs, const std::string& field, const nlohmann::json& value);
// The different values of `field` in the order in which they first appear; runs without it are passed over.
std::vector<nlohmann::json> Values(const Runs& runs, const std::string& field);
// Numbers of `field`, of the runs that have one.
std::vector<double> Numbers(const Runs& runs, const std::string& field);

// The runs of each mesh: the same name and as many triangles.
std::vector<Runs> ByMesh(const Runs& runs);
// Of the runs of one mesh: `field` of `tool` over `own_field` of `own_tool`, round by round.
std::vector<double> Ratios(const Runs& mesh, const std::string& tool, const std::string& field,
                           const std::string& own_tool, const std::string& own_field);

double Median(std::vector<double> values);  // NaN for none
double GeometricMean(const std::vector<double>& values);

// "12,345", and three significant digits: "0.0123", "1.23", "123".
std::string WithCommas(std::int64_t value);
std::string ThreeDigits(double value);

// "| a | b |" and a new line.
std::string Row(const std::vector<std::string>& cells);
// Row(cells) and the line under it, the first column to the left and the others to the right.
std::string HeaderRow(const std::vector<std::string>& cells);

// Throws std::runtime_error if it cannot be written.
void WriteText(const std::string& path, const std::string& text);

}  // namespace planish::bench
