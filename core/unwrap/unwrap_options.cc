#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/unwrap/unwrap.h"

namespace planish {
namespace {

absl::Status CheckRange(const std::string& field, int value, int low, int high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return OptionError(field, absl::StrCat(value, " is not in [", low, ", ", high, "]"));
}

absl::Status CheckSeams(const SeamOptions& seams) {
  if (!(seams.max_stretch >= 1.001 && seams.max_stretch <= 100)) {
    return OptionError("max_stretch", absl::StrFormat("%g is not in [1.001, 100]", seams.max_stretch));
  }
  if (!(seams.hard_edge_degrees >= 0 && seams.hard_edge_degrees <= 180)) {
    return OptionError("hard_edge_degrees",
                       absl::StrFormat("%g is not in (0, 180], nor 0 for none", seams.hard_edge_degrees));
  }
  if (seams.policy == SeamPolicy::kNone && (seams.hard_edge_degrees > 0 || !seams.corners.empty())) {
    return OptionError("seams", "none means that no edge is cut, but seams were given; choose keep, needed or auto");
  }
  return absl::OkStatus();
}

absl::Status CheckAtlas(const PackOptions& atlas) {
  PLANISH_RETURN_IF_ERROR(CheckRange("texture_size", atlas.texture_size, 16, 65536));
  PLANISH_RETURN_IF_ERROR(CheckRange("padding", atlas.padding, 0, 64));
  PLANISH_RETURN_IF_ERROR(CheckRange("tiles", atlas.tiles, 1, 100));
  if (2 * ((atlas.padding + 1) / 2) >= atlas.texture_size) {
    return OptionError("padding", absl::StrCat(atlas.padding, " texels leave no room in a tile of ", atlas.texture_size,
                                               ", which keeps half of them free at every rim"));
  }
  return absl::OkStatus();
}

absl::Status CheckCorners(const std::string& field, const std::vector<std::int32_t>& corners, std::int64_t num_faces) {
  const auto beyond =
      std::find_if(corners.begin(), corners.end(), [&](std::int32_t c) { return c < 0 || c >= 3 * num_faces; });
  if (beyond == corners.end()) return absl::OkStatus();
  return OptionError(field,
                     absl::StrCat("there is no corner ", *beyond, ": the mesh has ", num_faces,
                                  " faces, so corners 0 to ", 3 * num_faces - 1),
                     {{"corner", absl::StrCat(*beyond)}});
}

}  // namespace

absl::Status UnwrapOptions::Validate() const {
  PLANISH_RETURN_IF_ERROR(flatten.Validate());
  PLANISH_RETURN_IF_ERROR(CheckSeams(seams));
  PLANISH_RETURN_IF_ERROR(CheckAtlas(atlas));
  return CheckRange("threads", threads, 1, kMaxThreads);
}

absl::Status UnwrapOptions::ValidateSeams(std::int64_t num_faces) const {
  PLANISH_RETURN_IF_ERROR(CheckCorners("seam_corners", seams.corners, num_faces));
  return CheckCorners("uncut_corners", seams.uncut_corners, num_faces);
}

}  // namespace planish
