#include "core/unwrap/unwrap.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"
#include "core/base/radix_sort.h"
#include "core/base/status_macros.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/reordering.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

template <typename Number>
absl::Status CheckRange(const std::string& field, Number value, Number low, Number high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return OptionError(field, absl::StrCat(value, " is not in [", low, ", ", high, "]"));
}

absl::Status CheckSeams(const SeamOptions& seams) {
  PLANISH_RETURN_IF_ERROR(CheckRange("max_stretch", seams.max_stretch.value_or(1.001), 1.001, 100.0));
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
  PLANISH_RETURN_IF_ERROR(CheckRange("texture_size", atlas.texture_size, kMinTextureSize, kMaxTextureSize));
  PLANISH_RETURN_IF_ERROR(CheckRange("padding", atlas.padding, 0, 64));
  PLANISH_RETURN_IF_ERROR(CheckRange("tiles", atlas.tiles, 1, kMaxTiles));
  if (2 * ((atlas.padding + 1) / 2) >= atlas.texture_size) {
    return OptionError("padding", absl::StrCat(atlas.padding, " texels leave no room in a tile of ", atlas.texture_size,
                                               ", which keeps half of them free at every rim"));
  }
  return absl::OkStatus();
}

absl::Status CheckDensity(const UnwrapOptions& options) {
  const std::string field = "texels_per_unit";
  if (options.texels_per_unit == 0) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(CheckRange(field, options.texels_per_unit, 1e-300, kMostTexelsPerUnit));
  if (!options.pack) return OptionError(field, "charts that are not packed have no texture; leave pack on");
  if (options.seams.policy != SeamPolicy::kNone) return absl::OkStatus();
  return OptionError(field, "with seams none the mesh is one chart, which fills its tile; choose keep, needed or auto");
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

// Checks shared by face_atlas and face_weights: that each face has a value, that charts are packed, and that seams are
// allowed.
absl::Status CheckPerFace(const std::string& field, std::size_t count, const UnwrapOptions& options,
                          std::int64_t num_faces) {
  if (static_cast<std::int64_t>(count) != num_faces) {
    return OptionError(field,
                       absl::StrCat(count, " numbers for a mesh of ", num_faces, " faces; one for each is needed"));
  }
  if (!options.pack) return OptionError(field, "charts that are not packed have no atlas; leave pack on");
  if (options.seams.policy != SeamPolicy::kNone) return absl::OkStatus();
  return OptionError(field, "with seams none the mesh is one chart, which fills its tile; choose keep, needed or auto");
}

absl::Status CheckAtlases(const UnwrapOptions& options, std::int64_t num_faces) {
  const std::vector<std::int32_t>& atlas = options.face_atlas;
  if (atlas.empty()) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(CheckPerFace("face_atlas", atlas.size(), options, num_faces));
  const int most = options.layout == AtlasLayout::kUdim ? kMaxTiles / options.atlas.tiles : INT32_MAX;
  const auto wrong = std::find_if(atlas.begin(), atlas.end(), [&](std::int32_t a) { return a < 0 || a >= most; });
  if (wrong == atlas.end()) return absl::OkStatus();
  const std::string face = absl::StrCat(wrong - atlas.begin());
  if (*wrong < 0) return OptionError("face_atlas", absl::StrCat("there is no atlas ", *wrong), {{"face", face}});
  return OptionError(
      "face_atlas",
      absl::StrCat("there is no room for atlas ", *wrong, ": UDIM has ", kMaxTiles, " tiles here, so atlases 0 to ",
                   most - 1, "; use fewer, or stack them as textures of their own"),
      {{"face", face}});
}

absl::Status CheckWeights(const UnwrapOptions& options, std::int64_t num_faces) {
  const std::vector<float>& weights = options.face_weights;
  if (weights.empty()) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(CheckPerFace("face_weights", weights.size(), options, num_faces));
  const auto wrong =
      std::find_if(weights.begin(), weights.end(), [](float w) { return !(w >= kLeastWeight && w <= kMostWeight); });
  if (wrong == weights.end()) return absl::OkStatus();
  return OptionError("face_weights", absl::StrFormat("%g is not in [%g, %g]", *wrong, kLeastWeight, kMostWeight),
                     {{"face", absl::StrCat(wrong - weights.begin())}});
}

absl::Status CheckPolygons(const UnwrapOptions& options, std::int64_t num_faces) {
  const std::vector<std::int32_t>& polygon = options.face_polygon;
  if (polygon.empty()) return absl::OkStatus();
  if (std::ssize(polygon) != num_faces) {
    return OptionError("face_polygon", absl::StrCat(polygon.size(), " numbers for a mesh of ", num_faces,
                                                    " faces; one for each is needed"));
  }
  std::vector<std::int32_t> first_face(polygon.size(), -1);
  for (std::int32_t f = 0; f < std::ssize(polygon); ++f) {
    if (polygon[f] < 0 || polygon[f] >= num_faces) {
      return OptionError("face_polygon",
                         absl::StrCat("there is no polygon ", polygon[f], ": the mesh has ", num_faces,
                                      " faces, so polygons 0 to ", num_faces - 1),
                         {{"face", absl::StrCat(f)}});
    }
    std::int32_t& first = first_face[polygon[f]];
    if (first < 0) first = f;
    const auto differs = [&](const auto& values) { return !values.empty() && values[f] != values[first]; };
    const char* const field = differs(options.face_atlas)     ? "face_atlas"
                              : differs(options.face_weights) ? "face_weights"
                                                              : nullptr;
    if (field == nullptr) continue;
    return OptionError(field,
                       absl::StrCat("faces ", first, " and ", f, " are triangles of polygon ", polygon[f],
                                    ", which cannot be parted, but their numbers differ"),
                       {{"face", absl::StrCat(f)}});
  }
  return absl::OkStatus();
}

// Maps the charts in `todo`, and cuts charts until each map is sound. Terminates, since cuts make more charts, and a
// chart of one triangle is not cut. The first call in a job then joins charts.
absl::Status SolveAndRefine(Job* job, std::vector<std::int32_t> todo, Charts* charts) {
  bool goes_on = true;
  while (goes_on) {
    PLANISH_RETURN_IF_ERROR(SolveCharts(job, todo, charts));
    PLANISH_ASSIGN_OR_RETURN(goes_on, Refine(job, &todo, charts));
  }
  if (!std::exchange(charts->are_joined, true)) PLANISH_RETURN_IF_ERROR(JoinCharts(job, charts));
  for (const MappedChart& mapped : charts->charts) PLANISH_RETURN_IF_ERROR(mapped.status);
  return absl::OkStatus();
}

// Returns `made`; after a stop request STOPPED_EARLY if there is no valid map.
absl::Status CheckStopped(const Job& job, const absl::Status& made, const Charts& charts) {
  if (!job.execution.IsStopRequested()) return made;
  const auto error = [](const std::string& detail, const std::map<std::string, std::string>& metadata) {
    return MakeError(absl::StatusCode::kAborted, "STOPPED_EARLY",
                     absl::StrCat("stopped before there was a valid map to keep: ", detail), metadata);
  };
  if (ErrorInfoOf(made).reason == "SOLVER_FAILED") return error(std::string(made.message()), {});
  PLANISH_RETURN_IF_ERROR(made);
  std::int64_t turned = 0;
  for (const MappedChart& mapped : charts.charts) {
    if (mapped.map.flatten->stopped) turned += mapped.faults.flipped_or_degenerate;
  }
  if (turned == 0) return absl::OkStatus();
  return error(absl::StrCat(Counted(turned, "triangle is", "triangles are"), " still flipped or without area"),
               {{"count", absl::StrCat(turned)}});
}

}  // namespace

absl::Status UnwrapOptions::Validate() const {
  PLANISH_RETURN_IF_ERROR(flatten.Validate());
  PLANISH_RETURN_IF_ERROR(CheckSeams(seams));
  PLANISH_RETURN_IF_ERROR(CheckAtlas(atlas));
  PLANISH_RETURN_IF_ERROR(CheckDensity(*this));
  return CheckRange("threads", threads, 1, kMaxThreads);
}

absl::Status UnwrapOptions::ValidateFor(std::int64_t num_faces) const {
  PLANISH_RETURN_IF_ERROR(CheckCorners("seam_corners", seams.corners, num_faces));
  PLANISH_RETURN_IF_ERROR(CheckCorners("uncut_corners", seams.uncut_corners, num_faces));
  PLANISH_RETURN_IF_ERROR(CheckAtlases(*this, num_faces));
  PLANISH_RETURN_IF_ERROR(CheckWeights(*this, num_faces));
  return CheckPolygons(*this, num_faces);
}

namespace {

// Unwrap() without reordering the mesh. The metadata of warnings does not list faces yet.
absl::StatusOr<UnwrapResult> UnwrapInOrder(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control,
                                           const Execution& execution) {
  Job* watched = nullptr;
  const std::function<void(double)> reach = [&watched](double fraction) { watched->Reach(fraction); };
  Execution reporting = execution;
  reporting.progress = &reach;
  Job job = {mesh, options, control, reporting, Polygons(mesh.num_faces(), options.face_polygon)};
  watched = &job;
  PLANISH_ASSIGN_OR_RETURN(Charts charts, Segment(&job));
  const int first_count = charts.count();
  std::vector<std::int32_t> todo = Indices(first_count);
  // Charts may be solved and placed repeatedly, especially charts with faces too thin for the type, and ten full
  // packings would take most of the work. So all packings before the last one are drafts, except the first one if no
  // faces were widened.
  std::optional<bool> is_draft;
  std::optional<Atlas> atlas;
  while (true) {
    PLANISH_RETURN_IF_ERROR(CheckStopped(job, SolveAndRefine(&job, std::exchange(todo, {}), &charts), charts));
    if (!is_draft) is_draft = !charts.least_angle.empty();
    PLANISH_ASSIGN_OR_RETURN(atlas, PackCharts(&job, atlas ? &*atlas : nullptr, *is_draft, &charts));
    PLANISH_ASSIGN_OR_RETURN(Delivery delivery, Deliver(&job, charts, std::move(atlas->uv)));
    if (*is_draft) {
      ShakeCharts(job, &charts, &delivery);
    } else {
      NudgeCharts(job, &charts, &delivery);
    }
    bool goes_on = WidenCharts(&job, *atlas, delivery, &todo, &charts);
    if (!goes_on) {
      PLANISH_RETURN_IF_ERROR(FindOverlaps(&job, charts, *is_draft, &delivery));
      if (!*is_draft && delivery.overlaps.pairs > 0 && NudgeCharts(job, &charts, &delivery)) {
        PLANISH_RETURN_IF_ERROR(FindOverlaps(&job, charts, *is_draft, &delivery));
      }
      PLANISH_ASSIGN_OR_RETURN(goes_on, RefineDelivered(&job, *atlas, delivery, &todo, &charts));
    }
    if (goes_on || *is_draft) {
      is_draft = goes_on;
      continue;
    }
    if (charts.slits_are_moved) {
      WarnOfAddedSeams(FindAddedSeams(mesh, charts, first_count), options.seams.policy, &job.warnings);
    }
    return Report(&job, charts, *atlas, std::move(delivery));
  }
}

}  // namespace

absl::StatusOr<UnwrapResult> Unwrap(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control) {
  PLANISH_RETURN_IF_ERROR(options.Validate());
  PLANISH_RETURN_IF_ERROR(options.ValidateFor(mesh.num_faces()));
  ThreadTeam team(options.threads);
  const Execution execution = {&team, control.cancel, control.stop};
  // A single disc is not reordered here, since MakeTopology() sorts its vertices and faces.
  std::optional<Reordering> reordering;
  if (options.seams.policy != SeamPolicy::kNone && mesh.num_faces() >= options.tuning.reordered_faces) {
    reordering = Reordering::Of(mesh, execution);
  }
  absl::StatusOr<UnwrapResult> result;
  if (reordering) {
    result = UnwrapInOrder(reordering->Apply(mesh), reordering->Apply(options), control, execution);
    if (result.ok()) reordering->Restore(&*result);
  }
  // After an error of the mesh, unwraps the mesh without reordering, so that the error has the caller's numbers.
  if (!reordering || absl::IsInvalidArgument(result.status())) {
    result = UnwrapInOrder(mesh, options, control, execution);
  }
  PLANISH_RETURN_IF_ERROR(result.status());
  const Polygons polygons(mesh.num_faces(), options.face_polygon);
  for (UnwrapWarning& warning : result->warnings) {
    if (warning.faces.empty()) continue;
    warning.metadata["faces"] = FirstFaces(warning.faces);
    if (!polygons.are_triangles()) warning.metadata["polygons"] = absl::StrCat(polygons.CountIn(warning.faces));
  }
  return result;
}

}  // namespace planish
