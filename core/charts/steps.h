// The steps by which Segmentation (segmentation.h) makes charts, in their order.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/tuning.h"

namespace planish {

// ---- Small patches of faces with similar normals, from which charts are made (patches.cc).

// Per face: the number of its patch, ascending with the lowest face of each; -1 for faces that take no part. Patches
// are connected, and uncut edges are inside them. Neighbours with the most similar normals are joined first
// (hierarchical face clustering, Garland et al. 2001), as long as the mean normal of the patch has at least the length
// 1 - AtlasTuning::patch_deviation: a patch of a sphere spans about 33 degrees from its middle. Costs are rounded to
// 3e-5, so that rigid motion and scale change nothing. O(F log F).
std::vector<std::int32_t> MakePatches(const Surface& surface, const AtlasTuning& tuning,
                                      const Execution& execution = {});

// ---- From patches to charts: each patch becomes a disc, and neighbours are glued together as long as the result can
// lie flat with little stretch (merging.cc).

// `disc` has the disc of each face, in [0, count), or -1 for faces that take no part. On return, discs are numbered in
// the order of their lowest faces. Glues discs along their borders: first where a border is most of a disc's outline
// and bends least, as long as the estimated stretch of the union stays below max_stretch (or, where the parts are above
// that already, does not exceed theirs). Limits above AtlasTuning::first_stretch are reached in steps. Estimates take
// O(F log F) work; they start from the u in `kept` and leave their own there (StretchEstimate::TakeKept()). After a
// stop request the discs stay as they are by then. After a cancellation the result must not be used.
void MergeDiscs(std::int32_t count, double max_stretch, const AtlasTuning& tuning, const Execution& execution,
                Gluing* gluing, std::vector<std::int32_t>* disc, std::vector<float>* kept);

// Glues the piece that holds face `start` to a disc: the faces connected with `start` that have the same number in
// `piece`. None of them may be glued, or marked in `seen`, before. Marks them in `seen`. O(n) in the faces of the
// piece.
void GluePiece(std::int32_t start, const std::vector<std::int32_t>& piece, std::vector<char>* seen, Gluing* gluing);

// Glues every piece to a disc, whatever holes and handles it has. Faces with a negative number are left out.
void GluePieces(const std::vector<std::int32_t>& piece, Gluing* gluing);

// ---- Outlines without teeth (smoothing.cc).

// Hands single faces over to the disc across (or across a slit of the same one), again and again, wherever that makes
// seams shorter: a discrete curve-shortening flow, stopped after some sweeps so that seams stay about where they are.
// Seams along bends count as shorter. Discs stay discs and keep their numbers; no vertex of an outline opens wider than
// AtlasTuning::widest. `chart`, per face of the surface, has the disc of each of `faces`, and is updated; it must be -1
// for all other faces, which stay where they are. O(n) in `faces`. After a cancellation the result must not be used.
void SmoothOutlines(const AtlasTuning& tuning, const Execution& execution, std::vector<std::int32_t> faces,
                    Gluing* gluing, std::vector<std::int32_t>* chart);

// ---- New pairs of neighbours at edges of more than two faces, once there are charts (rejoining.cc).

// Import joins half-edges at crowded edges (Surface::crowded_edges) before anything is known about charts, and charts
// end at many of these edges all the same. The half-edges there can be paired differently. Returns pairs of them, by
// corner, that were not joined before and belong to different charts, so that a chart may go on where it had to end.
// Pairs of the smallest charts are chosen first, then pairs that bend least. `chart`: per face, its chart in `gluing`;
// -1 for faces without one. O(n) in the half-edges at crowded edges; edges with more than 64 of them are left out.
std::vector<std::array<std::int32_t, 2>> PairsToRejoin(const Gluing& gluing, const std::vector<std::int32_t>& chart);

}  // namespace planish
