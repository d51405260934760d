// planish_tuning_sweep [--quick] [CONSTANT...]: what each constant of FlattenTuning is worth. Halves and doubles them,
// one at a time (of those whose names begin with one of CONSTANT, if there are any), on discs by formula; one JSON
// object per solve on stdout. The default is solved beside each constant, so that CPU seconds compare.
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "core/abf/flatten.h"
#include "core/mesh/angles.h"
#include "nlohmann/json.hpp"
#include "tests/bench/bench_meshes.h"
#include "tests/bench/tuning_constants.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish::bench {
namespace {

// A disc and how it is flattened. Together they pass through every part of the solver that has constants.
struct Case {
  Case(std::string label, const Mesh& mesh, FlattenOptions with = {}, bool stopped = false)
      : name(std::move(label)),
        topology(DiscTopology(mesh).value()),
        target(MakeTargetAngles(topology, MeasuredAngles(mesh))),
        options(std::move(with)),
        stop_at_start(stopped) {}

  std::string name;
  Topology topology;
  TargetAngles target;
  FlattenOptions options;
  bool stop_at_start;
};

std::vector<Case> MakeCases(bool quick) {
  const std::int64_t n = quick ? 4 : 1;  // sizes are divided by it
  FlattenOptions jacobi, accurate, direct, convex;
  jacobi.preconditioner = PreconditionerType::kJacobi;
  accurate.linear_tolerance = 1e-8;
  direct.solver = SolverType::kDirect;
  convex.boundary = BoundaryType::kConvex;
  const int rings = quick ? 60 : 100, cells = quick ? 30 : 60;
  std::vector<Case> cases;
  cases.emplace_back("foot", MakeMesh("foot", 60000 / n));
  cases.emplace_back("head", MakeMesh("head", 20000 / n));
  cases.emplace_back("waves", MakeMesh("waves", 10000 / n));
  cases.emplace_back("twists", MakeMesh("twists", 6000 / n));
  cases.emplace_back("ear", MakeMesh("ear", 1796));
  cases.emplace_back("high hills", testing::Hills(cells, cells, 8));
  cases.emplace_back("higher hills", testing::Hills(cells, cells, 16));
  cases.emplace_back("small head", MakeMesh("head", 1000));
  cases.emplace_back("small sphere with a tiny hole", testing::PuncturedSphere(40, 0.01));
  cases.emplace_back("sphere with a tiny hole", testing::PuncturedSphere(rings, 0.01));
  cases.emplace_back("head, Jacobi", MakeMesh("head", 2000 / n), jacobi);
  cases.emplace_back("waves, linear systems to 1e-8", MakeMesh("waves", 4000 / n), accurate);
  cases.emplace_back("waves, direct solver", MakeMesh("waves", 2000 / n), direct);
  cases.emplace_back("head, convex boundary", MakeMesh("head", 4000 / n), convex);
  cases.emplace_back("high hills, convex boundary", testing::Hills(cells * 2 / 3, cells * 2 / 3, 8), convex);
  cases.emplace_back("foot, stopped at the start", MakeMesh("foot", 60000 / n), FlattenOptions(), true);
  return cases;
}

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Solves all cases with `tuning` and prints a line each: `constant` and its `value`, and which `variant` of it that is.
void Solve(const std::vector<Case>& cases, const FlattenTuning& tuning, const std::string& constant,
           const std::string& variant, double value) {
  for (const Case& one : cases) {
    FlattenOptions options = one.options;
    options.tuning = tuning;
    Interrupter stop;
    if (one.stop_at_start) stop.Interrupt();
    FlattenControl control;
    control.stop = &stop;
    const double start = CpuSeconds();
    const absl::StatusOr<Flattening> result = FlattenAngles(one.topology, one.target, options, control);
    nlohmann::json line = {{"constant", constant},
                           {"variant", variant},
                           {"value", value},
                           {"case", one.name},
                           {"triangles", one.topology.num_faces()},
                           {"cpu_seconds", CpuSeconds() - start}};
    if (result.ok()) {
      const FlattenSummary& summary = result->summary;
      line["newton_iterations"] = summary.newton_iterations;
      line["linear_iterations"] = summary.linear_iterations;
      line["preconditioner"] = Name(summary.preconditioner);
      line["barrier"] = summary.barrier;
      line["energy"] = summary.energy;
      line["ended"] = summary.converged ? "converged" : summary.stopped ? "stopped" : "not converged";
    } else {
      line["ended"] = "failed";
    }
    std::printf("%s\n", line.dump().c_str());
  }
  std::fflush(stdout);
}

int Main(int argc, char** argv) {
  bool quick = false;
  std::vector<std::string> wanted;
  for (int i = 1; i < argc; ++i) {
    if (argv[i] == std::string("--quick")) {
      quick = true;
    } else {
      wanted.emplace_back(argv[i]);
    }
  }
  const std::vector<Case> cases = MakeCases(quick);
  const FlattenTuning defaults;
  Solve(cases, defaults, "", "first", 0);  // memory and caches are warm from here on
  FlattenTuning tuning;
  const std::vector<TuningConstant> constants = ConstantsOf(&tuning);
  for (const TuningConstant& constant : constants) {
    bool skip = !wanted.empty();
    for (const std::string& name : wanted) skip = skip && !constant.name.starts_with(name);
    if (skip) continue;
    Solve(cases, defaults, constant.name, "default", constant.Value());
    for (const auto& [variant, factor] : {std::pair("halved", 0.5), std::pair("doubled", 2.0)}) {
      constant.Multiply(factor);
      Solve(cases, tuning, constant.name, variant, constant.Value());
      tuning = defaults;
    }
    std::fprintf(stderr, "%s\n", constant.name.c_str());
  }
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
