// What callers are told about a result, in words and as data.
#pragma once

#include <cstdint>
#include <vector>

#include "core/charts/surface.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"

namespace planish {

// FACES_WITHOUT_AREA, EDGES_NON_MANIFOLD, ORIENTATION_INCONSISTENT. `ignored` marks the faces without area.
void WarnOfSurface(const Surface& surface, const std::vector<char>& ignored, std::vector<UnwrapWarning>* warnings);

// FACES_WIDENED: `widened` are all such faces, ascending.
void WarnOfWidened(const std::vector<std::int32_t>& widened, Precision precision, std::vector<UnwrapWarning>* warnings);

// SEAMS_ADDED: `slit` pieces that are no discs were cut open, `added` charts came from splitting others.
void WarnOfAddedSeams(std::int64_t slit, std::int64_t added, std::vector<UnwrapWarning>* warnings);

// NOT_CONVERGED, PRECONDITIONER_CHANGED, LINEAR_SOLVES_FAILED, BOUNDARY_NOT_SETTLED, BARRIER_KEPT, BARYCENTRIC_MAP,
// STRETCH_ABOVE_LIMIT: one warning for all charts concerned. `max_stretch` 0: no limit. `stopped`: charts may have been
// left without the cuts that they need.
void WarnOfCharts(const std::vector<ChartReport>& charts, double max_stretch, bool stopped,
                  std::vector<UnwrapWarning>* warnings);

// STOPPED: the caller asked for the best map so far.
void WarnOfStop(const std::vector<ChartReport>& charts, std::vector<UnwrapWarning>* warnings);

// UV_FLIPPED, UV_DEGENERATE, UV_OVERLAPPING.
void WarnOfFaults(const OrientationFaults& orientation, const Overlaps& overlaps, std::vector<UnwrapWarning>* warnings);

// {"count", "faces"} as metadata, the latter with the first kMaxNamed of these faces.
std::map<std::string, std::string> FaceMetadata(std::int64_t count, const std::vector<std::int32_t>& faces);

}  // namespace planish
