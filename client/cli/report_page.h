// The page of a report: one HTML file with all it shows, for browsers with WebGL 2.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/check_map.h"
#include "client/cli/json.h"
#include "client/cli/mesh_input.h"

namespace planish::cli {

// A map on the page. What it refers to must live until the page is made.
struct ReportedMap {
  std::string name;  // "hero.glb", "before"
  const MeshInput& input;
  const CheckedMap& map;  // has UV
  const MapCheckOptions& options;
  double padding = 0;  // texels round charts that the layout shows
};

// The page: client/report/template.html with the data in it. Positions and UV are rounded to 16 bits of their extent;
// the data take some 10 bytes a triangle. `unwrap` is what `unwrap --json` printed about the last map, with "newton"
// (NewtonLog::ToJson) if that is known; null: nothing. At most two maps. Deterministic.
std::string ReportPage(const std::vector<ReportedMap>& maps, const std::optional<Json>& unwrap);

// The Newton steps of a job as they are reported.
class NewtonLog {
 public:
  // Not thread-safe, as events come one by one.
  void OnEvent(const Event& event);
  // [chart, steps taken, largest residual] of each step that was told; of more than 200 charts those of most steps.
  Json ToJson() const;
  double tolerance() const { return tolerance_; }

 private:
  struct Step {
    int iteration;
    double residual;
  };
  std::map<int, std::vector<Step>> steps_;  // by chart
  double tolerance_ = 0;
};

}  // namespace planish::cli
