// planish_solve_time MESH [flags]: what the unwrapping of one mesh costs, one JSON object per run on stdout.
//
//   seconds, cpu_seconds   wall clock and CPU of all threads, for `solve` alone and for `map`: disc check, solve,
//   layout
//                          and placement, without reading the file and without the verifier
//   peak_bytes             of the first run, the most memory the unwrapping held at once beyond the mesh: VmHWM, set
//                          back before it starts, less what was resident then. Later runs have that memory at hand.
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <string>

#include "CLI/CLI.hpp"
#include "core/base/heap.h"
#include "core/base/timer.h"
#include "core/unwrap/unwrap.h"
#include "nlohmann/json.hpp"
#include "tests/bench/bench_meshes.h"
#include "tests/testing/discs.h"

namespace planish::bench {
namespace {

struct Arguments {
  std::string mesh;
  int runs = 1;
  double time_limit = 1e9;
  std::string step;
  UnwrapOptions options;
};

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// A line "VmHWM:   1234 kB" of /proc/self/status, in bytes; 0 where there is none.
std::int64_t StatusBytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(field + ":")) return 1024 * std::strtoll(line.c_str() + field.size() + 1, nullptr, 10);
  }
  return 0;
}

// Gives freed memory back, asks for huge pages for what comes next, and sets VmHWM to what is resident; returns that.
std::int64_t ResetPeak() {
  ReturnFreedMemory();
  ReserveHeap(std::size_t{1} << 30);
  std::ofstream("/proc/self/clear_refs") << "5";
  return StatusBytes("VmRSS");
}

// The value of an option that JSON readers can tell from infinity.
nlohmann::json Finite(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json Measure(const Mesh& mesh, const Arguments& arguments, bool first) {
  Interrupter interrupter;
  FlattenProgress last;
  Timer timer;
  const double cpu_start = CpuSeconds();
  double cpu_start_solve = 0, cpu_solve = 0, cpu_flat = 0, cpu_map = 0;
  UnwrapControl control;
  control.cancel = &interrupter;
  control.on_progress = [&](const UnwrapProgress& progress) {
    if (timer.Seconds() > arguments.time_limit) interrupter.Interrupt();
    if (progress.stage == UnwrapStage::kSolve) {
      if (cpu_start_solve == 0) cpu_start_solve = CpuSeconds();
      last = progress.flatten;
    }
    if (progress.stage == UnwrapStage::kLayout) cpu_solve = CpuSeconds() - cpu_start_solve;
    if (progress.stage == UnwrapStage::kPack) cpu_flat = CpuSeconds() - cpu_start_solve;
    if (progress.stage == UnwrapStage::kVerify) cpu_map = CpuSeconds() - cpu_start;
  };
  const FlattenOptions& asked = arguments.options.flatten;
  nlohmann::json line = {{"mesh", LabelOf(arguments.mesh)},
                         {"step", arguments.step},
                         {"tool", "planish"},
                         {"triangles", mesh.num_faces()},
                         {"threads", arguments.options.threads},
                         {"solver", Name(asked.solver)},
                         {"system", Name(asked.system)},
                         {"preconditioner", Name(asked.preconditioner)},
                         {"linear_tolerance", asked.linear_tolerance},
                         {"tolerance", asked.tolerance}};
  const std::int64_t before = first ? ResetPeak() : 0;
  timer.Restart();
  UnwrapOptions options = arguments.options;
  options.seams.policy = SeamPolicy::kNone;
  const auto result = Unwrap(mesh, options, control);
  const double seconds = timer.Seconds();
  if (first) line["peak_bytes"] = StatusBytes("VmHWM") - before;
  if (!result.ok()) {
    line["ended"] = interrupter.IsInterrupted() ? "time limit" : std::string(result.status().message());
    line["newton_iterations"] = last.newton_iteration;
    line["linear_iterations"] = last.linear_iterations;
    line["solve_seconds"] = line["map_seconds"] = seconds;
    line["solve_cpu_seconds"] = line["map_cpu_seconds"] = CpuSeconds() - cpu_start;
    return line;
  }
  const FlattenSummary& summary = *result->charts.at(0).flatten;
  const UnwrapSeconds& stage = result->seconds;
  line["ended"] = summary.converged ? "converged" : summary.stop_message;
  line["used"] = {{"solver", Name(summary.solver)},
                  {"system", Name(summary.system)},
                  {"preconditioner", Name(summary.preconditioner)}};
  line["newton_iterations"] = summary.newton_iterations;
  line["linear_iterations"] = summary.linear_iterations;
  line["residual"] = summary.residual.Max();
  line["charts_seconds"] = stage.charts;
  line["solve_seconds"] = stage.solve;
  line["layout_seconds"] = stage.layout;
  line["pack_seconds"] = stage.pack;
  line["map_seconds"] = stage.charts + stage.solve + stage.layout + stage.pack;
  line["verify_seconds"] = stage.verify;
  line["solve_cpu_seconds"] = cpu_solve;
  line["flat_cpu_seconds"] = cpu_flat;  // from target angles to UV
  line["map_cpu_seconds"] = cpu_map;
  line["abf_energy"] = Finite(result->quality.abf_energy);
  line["conformal_distortion_mean"] = Finite(result->quality.conformal_distortion_mean);
  line["flipped"] = result->quality.flipped;
  line["degenerate"] = result->quality.degenerate;
  line["overlapping"] = result->quality.overlapping;
  line["precision"] = result->precision == Precision::kDouble ? "double" : "float";
  line["barrier"] = summary.barrier;
  line["boundary_active"] = summary.boundary.active;
  line["boundary_settled"] = summary.boundary.settled;
  return line;
}

template <typename Type>
std::map<std::string, Type> ByName(std::initializer_list<Type> values) {
  std::map<std::string, Type> names;
  for (const Type value : values) names[Name(value)] = value;
  return names;
}

int Main(int argc, char** argv) {
  CLI::App app("What the unwrapping of one mesh costs, one JSON object per run.");
  Arguments arguments;
  FlattenOptions& flatten = arguments.options.flatten;
  using enum SolverType;
  app.add_option("mesh", arguments.mesh, "NAME:TRIANGLES, PATH or PATH@LEVELS (tests/bench/bench_meshes.h)")
      ->required();
  app.add_option("--runs", arguments.runs, "how often")->check(CLI::Range(1, 1000));
  app.add_option("--time-limit", arguments.time_limit, "seconds after which a run is given up");
  app.add_option("--step", arguments.step, "a name that goes into the output as it is");
  app.add_option("--solver", flatten.solver)
      ->transform(CLI::CheckedTransformer(ByName({kAuto, kUzawa, kMinres, kDirect})));
  app.add_option("--system", flatten.system)
      ->transform(CLI::CheckedTransformer(ByName({SystemType::kAuto, SystemType::kFull, SystemType::kReduced})));
  app.add_option("--preconditioner", flatten.preconditioner)
      ->transform(CLI::CheckedTransformer(
          ByName({PreconditionerType::kAuto, PreconditionerType::kNone, PreconditionerType::kJacobi,
                  PreconditionerType::kCholesky, PreconditionerType::kAmg})));
  app.add_option("--hessian", flatten.hessian)
      ->transform(CLI::CheckedTransformer(ByName({HessianType::kAuto, HessianType::kConvex, HessianType::kExact})));
  app.add_option("--boundary", flatten.boundary)
      ->transform(CLI::CheckedTransformer(ByName({BoundaryType::kFree, BoundaryType::kConvex})));
  app.add_option("--threads", arguments.options.threads, "threads that work on it");
  app.add_option("--tolerance", flatten.tolerance, "radians, per angle");
  app.add_option("--linear-tolerance", flatten.linear_tolerance, "relative, of every linear solve; 0: forcing terms");
  CLI11_PARSE(app, argc, argv);
  KeepFreedMemory();

  const auto mesh = LoadMesh(arguments.mesh);
  if (!mesh.ok()) {
    std::fprintf(stderr, "%s\n", std::string(mesh.status().message()).c_str());
    return 2;
  }
  for (int i = 0; i < arguments.runs; ++i) {
    const nlohmann::json line = Measure(*mesh, arguments, /*first=*/i == 0);
    std::printf("%s\n", line.dump().c_str());
    std::fflush(stdout);
    if (line["ended"] == "time limit") break;  // the next run would end there too
  }
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
