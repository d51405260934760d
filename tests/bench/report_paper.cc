// Table 1 and figure 2 of the paper, and what each step away from it buys.
#include <cmath>
#include <optional>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

struct PaperRow {
  std::int64_t triangles;
  const char* mesh;
  const char* name;
  double minres, uzawa;  // seconds
};

constexpr PaperRow kTable1[] = {{1796, "ear", "ear", 3, 1},
                                {5420, "head", "man head", 26, 18},
                                {6000, "twists", "twists", 2, 1},
                                {10000, "waves", "Goldfeather", 16, 7},
                                {24000, "waves", "Goldfeather", 74, 31},
                                {20000, "foot", "foot", 346, 115}};

constexpr const char* kSolvers[] = {"minres", "uzawa"};

bool Converged(const nlohmann::json& run) {
  return run["ended"] == "converged";
}

double SolveSeconds(const Runs& runs) {
  return Median(Numbers(runs, "solve_cpu_seconds"));
}

// Seconds, or "over N".
std::string Seconds(const Runs& runs) {
  if (runs.empty()) return "-";
  const std::string seconds = ThreeDigits(SolveSeconds(runs));
  if (Converged(runs.front())) return seconds;
  return runs.front()["ended"] == "time limit" ? "over " + seconds : "not converged (" + seconds + ")";
}

// Newton steps, linear iterations, seconds.
std::string Cell(const Runs& runs) {
  if (runs.empty()) return "-";
  return std::to_string(runs.front()["newton_iterations"].get<int>()) + " / " +
         WithCommas(runs.front()["linear_iterations"]) + " / " + Seconds(runs);
}

std::string MeshCell(const nlohmann::json& run) {
  return run["mesh"].get<std::string>() + ", " + WithCommas(run["triangles"]);
}

// One run per mesh of the paper's size and name, in the paper's order, whatever the step.
std::string Table1(const Runs& runs, const std::string& first, const std::string& last) {
  std::string text = "## Table 1 again\n\n";
  text += HeaderRow({"mesh, triangles", "paper's mesh", "paper: MINRES", "paper: Uzawa", "as written: MINRES",
                     "as written: Uzawa", "all steps: MINRES", "all steps: Uzawa"});
  for (const auto& triangles : Values(runs, "triangles")) {
    const Runs mesh = Where(runs, "triangles", triangles);
    const PaperRow* paper = nullptr;
    for (const PaperRow& row : kTable1) {
      if (row.triangles == triangles && row.mesh == mesh.front()["mesh"]) paper = &row;
    }
    std::vector<std::string> cells = {MeshCell(mesh.front()), paper ? paper->name : "-",
                                      paper ? ThreeDigits(paper->minres) : "-",
                                      paper ? ThreeDigits(paper->uzawa) : "-"};
    for (const std::string& step : {first, last}) {
      for (const char* solver : kSolvers) cells.push_back(Seconds(Where(Where(mesh, "step", step), "solver", solver)));
    }
    text += Row(cells);
  }
  return text +
         "\nCPU seconds. The paper's were measured on a 1.7 GHz Xeon, on its own meshes; the rightmost four here.\n";
}

std::string StepTable(const Runs& runs, const std::vector<nlohmann::json>& steps, const std::string& solver) {
  std::vector<std::string> header = {"mesh, triangles"};
  for (const auto& step : steps) header.push_back(step);
  std::string text = HeaderRow(header);
  for (const auto& triangles : Values(runs, "triangles")) {
    const Runs mesh = Where(Where(runs, "triangles", triangles), "solver", solver);
    if (mesh.empty()) continue;
    std::vector<std::string> cells = {MeshCell(mesh.front())};
    for (const auto& step : steps) cells.push_back(Cell(Where(mesh, "step", step)));
    text += Row(cells);
  }
  return text;
}

// Geometric means over the meshes on which both steps converged.
std::string Gain(const Runs& runs, const nlohmann::json& from, const nlohmann::json& to, const std::string& solver) {
  std::vector<double> iterations, seconds;
  for (const auto& triangles : Values(runs, "triangles")) {
    const Runs mesh = Where(Where(runs, "triangles", triangles), "solver", solver);
    const Runs before = Where(mesh, "step", from), after = Where(mesh, "step", to);
    if (before.empty() || after.empty() || !Converged(before.front()) || !Converged(after.front())) continue;
    iterations.push_back(before.front()["linear_iterations"].get<double>() /
                         after.front()["linear_iterations"].get<double>());
    seconds.push_back(SolveSeconds(before) / SolveSeconds(after));
  }
  if (iterations.empty()) return "-";
  return ThreeDigits(GeometricMean(iterations)) + " / " + ThreeDigits(GeometricMean(seconds)) + " (" +
         std::to_string(iterations.size()) + ")";
}

std::string GainTable(const Runs& runs, const std::vector<nlohmann::json>& steps) {
  std::string text = HeaderRow({"from", "to", "MINRES", "Uzawa"});
  const auto add = [&](const nlohmann::json& from, const nlohmann::json& to) {
    text += Row({from, to, Gain(runs, from, to, "minres"), Gain(runs, from, to, "uzawa")});
  };
  for (std::size_t i = 1; i < steps.size(); ++i) add(steps[i - 1], steps[i]);
  add(steps.front(), steps.back());
  return text;
}

std::string Figure2(const Runs& runs) {
  std::string text = "\n## Figure 2 again: nonzeros of the matrix of eq. 5\n\n" +
                     HeaderRow({"mesh, triangles", "interior vertices", "rows", "eq. 6 (logarithm)",
                                "product, as a difference", "product, as a quotient (eq. 3)", "difference / eq. 6"});
  for (const auto& run : Where(runs, "step", "figure 2")) {
    text += Row({MeshCell(run), WithCommas(run["interior_vertices"]), WithCommas(run["rows"]),
                 WithCommas(run["logarithm"]), WithCommas(run["difference"]), WithCommas(run["product"]),
                 ThreeDigits(run["difference"].get<double>() / run["logarithm"].get<double>())});
  }
  text += Row({"paper's ear, 1,796", "-", "-", "47,607", "100,044", "-", ThreeDigits(100044.0 / 47607)});
  return text +
         "\nBoth triangles of the symmetric matrix, no entries in its zero block (`tests/core/kkt.h` has the "
         "formulas). "
         "The paper's numbers are\nthose of such a mesh with the wheel condition as a difference of two products, as "
         "the original ABF has it: sines of angles\nbefore and after the vertex are not coupled.\n";
}

// One block of "step seconds iterations" per mesh and solver, named for gnuplot's key.
std::string Columns(const Runs& runs, const std::vector<nlohmann::json>& steps) {
  std::string text;
  for (const char* solver : kSolvers) {
    for (const auto& triangles : Values(runs, "triangles")) {
      const Runs mesh = Where(Where(runs, "triangles", triangles), "solver", solver);
      if (mesh.empty()) continue;
      if (!text.empty()) text += "\n\n";  // between gnuplot's blocks
      text += "\"" + mesh.front()["mesh"].get<std::string>() + " " + WithCommas(triangles) + "\"\n";
      for (std::size_t i = 0; i < steps.size(); ++i) {
        const Runs run = Where(mesh, "step", steps[i]);
        if (run.empty()) continue;
        // The fourth column is 1 for a run that was given up.
        text += std::to_string(i) + " " + std::to_string(SolveSeconds(run)) + " " +
                std::to_string(run.front()["linear_iterations"].get<std::int64_t>()) + " " +
                (Converged(run.front()) ? "0" : "1") + "\n";
      }
    }
  }
  return text;
}

}  // namespace

std::string ReportPaper(const Runs& runs, const std::string& columns) {
  Runs solves;
  for (const auto& run : runs) {
    if (run.contains("solver")) solves.push_back(run);
  }
  const std::vector<nlohmann::json> steps = Values(solves, "step");
  WriteText(columns + ".steps", Columns(solves, steps));
  return Table1(solves, steps.front(), steps.back()) +
         "\n## What each step buys\n\nNewton steps / linear iterations / CPU seconds.\n\nUzawa (section 7.2):\n\n" +
         StepTable(solves, steps, "uzawa") + "\nMINRES (section 7.1):\n\n" + StepTable(solves, steps, "minres") +
         "\nTimes fewer linear iterations / times faster, geometric means over the meshes (their number) where both "
         "converged:\n\n" +
         GainTable(solves, steps) + Figure2(runs);
}

}  // namespace planish::bench
