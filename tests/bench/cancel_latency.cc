// planish_cancel_latency MESH [THREADS]: how long each stage but the solve goes on after an interrupt. One JSON object
// per stage: its seconds uninterrupted, and the longest wait over interrupts at nine points on its way.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/files/mesh_file.h"
#include "core/abf/flatten.h"
#include "core/abf/layout.h"
#include "core/abf/topology.h"
#include "core/base/execution.h"
#include "core/base/timer.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/pack/outline.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"
#include "nlohmann/json.hpp"
#include "tests/testing/discs.h"

namespace planish {
namespace {

using Stage = std::function<void(const Execution&)>;

double SecondsAfterInterrupt(const Stage& stage, ThreadTeam* team, double after) {
  Interrupter interrupter;
  Timer since_interrupt;
  std::thread caller([&] {
    std::this_thread::sleep_for(std::chrono::duration<double>(after));
    since_interrupt.Restart();
    interrupter.Interrupt();
  });
  stage({team, &interrupter});
  const Timer end = since_interrupt;
  const double seconds = interrupter.IsInterrupted() ? end.Seconds() : 0;
  caller.join();
  return seconds;
}

void Measure(const std::string& name, ThreadTeam* team, const Stage& stage) {
  Timer timer;
  stage({team, nullptr});
  const double whole = timer.Seconds();
  double longest = 0;
  for (int i = 1; i < 10; ++i) longest = std::max(longest, SecondsAfterInterrupt(stage, team, whole * i / 10));
  const nlohmann::json line = {{"stage", name}, {"seconds", whole}, {"longest_wait_seconds", longest}};
  std::printf("%s\n", line.dump().c_str());
}

int Run(const Mesh& mesh, int threads) {
  ThreadTeam team(threads);
  const Execution all = {&team, nullptr};
  Measure("charts", &team, [&](const Execution& e) { (void)DiscTopology(mesh, e); });
  const absl::StatusOr<Topology> topology = DiscTopology(mesh, all);
  if (!topology.ok()) {
    std::fprintf(stderr, "%s\n", std::string(topology.status().message()).c_str());
    return 1;
  }
  Measure("measured angles", &team, [&](const Execution& e) { MeasuredAngles(mesh, e); });
  const Eigen::VectorXd measured = MeasuredAngles(mesh, all);
  Measure("target angles", &team, [&](const Execution& e) { MakeTargetAngles(*topology, measured, e); });
  const TargetAngles target = MakeTargetAngles(*topology, measured, all);
  FlattenControl control;
  control.team = &team;
  const absl::StatusOr<Flattening> flattening = FlattenAngles(*topology, target, {}, control);
  if (!flattening.ok()) {
    std::fprintf(stderr, "%s\n", std::string(flattening.status().message()).c_str());
    return 1;
  }
  Measure("layout", &team, [&](const Execution& e) { LayOut(*topology, flattening->angles, e); });
  std::vector<Vec2> positions = LayOut(*topology, flattening->angles, all);
  const auto outline = [&] {
    std::vector<Vec2> points;
    for (std::int32_t c = 0; c < topology->num_corners(); ++c) {
      if (topology->opposite[c] < 0) points.push_back(positions[Origin(topology->faces, c)]);
    }
    return points;
  };
  Measure("pack", &team, [&](const Execution& e) {
    std::vector<Vec2> points = positions;
    PlaceInUnitSquare(outline(), &points, e);
  });
  PlaceInUnitSquare(outline(), &positions, all);
  CornerUv uv;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) uv.insert(uv.end(), {positions[v].x(), positions[v].y()});
  }
  Measure("orientations", &team, [&](const Execution& e) { CheckOrientations(uv, e); });
  Measure("overlaps", &team, [&](const Execution& e) { CheckOverlaps(topology->opposite, uv, {}, e); });
  OrientationFaults pretend;
  pretend.flipped = 1;
  Measure("overlaps, pair by pair", &team,
          [&](const Execution& e) { CheckOverlaps(topology->opposite, uv, pretend, e); });
  std::vector<std::int32_t> faces(mesh.faces.size());
  std::iota(faces.begin(), faces.end(), 0);
  Measure("distortion", &team,
          [&](const Execution& e) { MeasureDistortion(mesh, faces, measured, target, uv, {}, e); });
  return 0;
}

}  // namespace
}  // namespace planish

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: planish_cancel_latency MESH [THREADS]\n");
    return 2;
  }
  const auto file = planish::ReadMeshFile(argv[1]);
  if (!file.ok()) {
    std::fprintf(stderr, "%s\n", std::string(file.status().message()).c_str());
    return 2;
  }
  return planish::Run(planish::Triangulate(file->mesh).mesh, argc > 2 ? std::atoi(argv[2]) : 1);
}
