// What `planish check` has to say about a map.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/check_map.h"
#include "client/cli/json.h"
#include "client/cli/mesh_input.h"

namespace planish::cli {

struct RequirementResult {
  std::string name;  // "no-overlap", "max-stretch", ...
  bool met = true;
  std::string message;  // if not met: what there is instead
};

// What was asked for, in the order of the flags' help. That there are UV at all is always asked for.
std::vector<RequirementResult> CheckRequirements(const CheckArguments& wanted, const CheckedMap& map);
bool AreMet(const std::vector<RequirementResult>& results);

// Names a map: "hero.glb", or "hero.glb TEXCOORD_1" where `uv_set` is not 0.
std::string MapName(const std::string& path, int uv_set);

// What the map is like, as names and values; nothing without UV.
std::vector<std::pair<std::string, std::string>> CheckLines(const MeshInput& input, const MapCheckOptions& options,
                                                            const CheckedMap& map);
// For people: some twenty lines, whatever the map. `uv_sets` are those that the file has.
std::string CheckText(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets,
                      const MapCheckOptions& options, const CheckedMap& map,
                      const std::vector<RequirementResult>& results);
// For programs; the fields are described in client/README.md.
Json CheckJson(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets, const MapCheckOptions& options,
               const CheckedMap& map, const std::vector<RequirementResult>& results);

}  // namespace planish::cli
