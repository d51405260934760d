// The sweep over the constants of FlattenTuning.
#include <algorithm>
#include <cstdio>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

constexpr const char* kVariants[] = {"halved", "doubled"};

std::int64_t Total(const Runs& runs, const std::string& field) {
  std::int64_t total = 0;
  for (const auto& run : runs) total += run.value(field, std::int64_t{0});
  return total;
}

double CpuTotal(const Runs& runs) {
  double total = 0;
  for (const auto& run : runs) total += run["cpu_seconds"].get<double>();
  return total;
}

Runs Except(const Runs& runs, const std::string& name) {
  Runs others;
  for (const auto& run : runs) {
    if (run["case"] != name) others.push_back(run);
  }
  return others;
}

// Compares what does not depend on the machine.
bool SameCourse(const nlohmann::json& a, const nlohmann::json& b) {
  for (const char* field : {"ended", "newton_iterations", "linear_iterations", "preconditioner", "barrier", "energy"}) {
    if (a.contains(field) != b.contains(field) || (a.contains(field) && a[field] != b[field])) return false;
  }
  return true;
}

bool SameCourse(const Runs& a, const Runs& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!SameCourse(a[i], b[i])) return false;
  }
  return true;
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// "+1 / -12 / 0.97", with the cases that ended in another way.
std::string Change(const Runs& base, const Runs& varied) {
  if (SameCourse(base, varied)) return "the same";
  char counts[96];
  std::snprintf(counts, sizeof counts, "%+lld / %+lld / %.2f",
                static_cast<long long>(Total(varied, "newton_iterations") - Total(base, "newton_iterations")),
                static_cast<long long>(Total(varied, "linear_iterations") - Total(base, "linear_iterations")),
                CpuTotal(varied) / CpuTotal(base));
  std::string text = counts;
  for (std::size_t i = 0; i < base.size(); ++i) {
    const auto& before = base[i];
    const auto& after = varied[i];
    if (before["ended"] != after["ended"]) {
      text += "; " + after["case"].get<std::string>() + ": " + after["ended"].get<std::string>();
    } else if (before.value("barrier", 0.0) != after.value("barrier", 0.0)) {
      text += "; " + after["case"].get<std::string>() + ": a barrier of " + Number(after["barrier"]);
    } else if (before.value("preconditioner", "") != after.value("preconditioner", "")) {
      text += "; " + after["case"].get<std::string>() + ": " + after["preconditioner"].get<std::string>();
    }
  }
  return text;
}

}  // namespace

std::string ReportTuning(const Runs& runs) {
  const Runs first = Where(runs, "variant", "first");
  // The hardest case has a column of its own: it would hide what the others show.
  const std::string hardest = (*std::max_element(first.begin(), first.end(), [](const auto& a, const auto& b) {
    return a.value("linear_iterations", std::int64_t{0}) < b.value("linear_iterations", std::int64_t{0});
  }))["case"];
  std::string text = HeaderRow(
      {"case", "triangles", "Newton steps", "linear iterations", "CPU seconds", "preconditioner", "barrier", "ended"});
  for (const auto& run : first) {
    text += Row({run["case"], WithCommas(run["triangles"]), std::to_string(run.value("newton_iterations", 0)),
                 WithCommas(run.value("linear_iterations", std::int64_t{0})), ThreeDigits(run["cpu_seconds"]),
                 run.value("preconditioner", "-"), Number(run.value("barrier", 0.0)), run["ended"]});
  }
  std::string without_effect;
  std::vector<std::string> header = {"constant", "default"};
  for (const char* variant : kVariants) header.insert(header.end(), {variant, "others", hardest});
  std::string table = HeaderRow(header);
  for (const auto& constant : Values(runs, "constant")) {
    if (constant == "") continue;  // the first solves
    const Runs own = Where(runs, "constant", constant), base = Where(own, "variant", "default");
    std::vector<std::string> cells = {"`" + constant.get<std::string>() + "`", Number(base.front()["value"])};
    bool matters = false;
    for (const char* variant : kVariants) {
      const Runs varied = Where(own, "variant", variant);
      matters = matters || !SameCourse(base, varied);
      cells.push_back(Number(varied.front()["value"]));
      cells.push_back(Change(Except(base, hardest), Except(varied, hardest)));
      cells.push_back(Change(Where(base, "case", hardest), Where(varied, "case", hardest)));
    }
    if (matters) {
      table += Row(cells);
    } else {
      without_effect += (without_effect.empty() ? "" : ", ") + cells.front();
    }
  }
  return text + "\nAll " + std::to_string(first.size()) +
         " together: " + std::to_string(Total(first, "newton_iterations")) + " Newton steps, " +
         WithCommas(Total(first, "linear_iterations")) +
         " linear iterations.\n\nThe next table has the halved and the doubled value of each constant, and what either "
         "changes: Newton steps more or fewer /\nlinear iterations more or fewer / CPU seconds over those of the "
         "default "
         "beside it (one run each: good to ten per cent or so).\n\"" +
         hardest +
         "\" is apart from the others, since it takes half of all iterations and chance decides much of its "
         "course.\n\n" +
         table +
         "\nWithout effect on these discs, halved or doubled: " + (without_effect.empty() ? "none" : without_effect) +
         ".\n";
}

}  // namespace planish::bench
