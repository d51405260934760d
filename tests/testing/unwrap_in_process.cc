#include "tests/testing/unwrap_in_process.h"

#include "core/unwrap/unwrap.h"

namespace planish::testing {

InProcessMap UnwrapInProcess(const Mesh& mesh, const std::vector<std::int32_t>& face_polygon, bool needs_float,
                             bool for_texture) {
  UnwrapOptions options;
  options.face_polygon = face_polygon;
  if (for_texture) options.seams.prefer = SeamPreference::kTexture;
  if (needs_float) options.precision = Precision::kFloat;
  absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, {});
  InProcessMap map;
  if (!result.ok()) {
    map.error = result.status().ToString();
    map.is_refused = absl::IsInvalidArgument(result.status());
    return map;
  }
  map.uv = std::move(result->uv);
  map.is_float = result->precision == Precision::kFloat;
  for (const UnwrapWarning& warning : result->warnings) {
    if (warning.reason == "POLYGON_TORN") map.torn_faces = warning.faces;
  }
  return map;
}

}  // namespace planish::testing
