// The steps that Segmentation (segmentation.h) is made of, in their order.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/tuning.h"

namespace planish {

// ---- Small patches of faces that look the same way: what charts are made of (patches.cc).

// Per face: the number of its patch, ascending with the lowest face of each; -1 for faces that take no part. Patches
// are connected and follow no uncut edge. Neighbours are joined as long as the mean normal stays longer than a set part
// of 1, those with the most similar normals first (hierarchical face clustering, Garland et al. 2001): a patch of a
// sphere spans about 33 degrees from its middle. Costs are rounded to 3e-5, so that rigid motion and scale change
// nothing. O(F log F).
std::vector<std::int32_t> MakePatches(const Surface& surface, const AtlasTuning& tuning,
                                      const Execution& execution = {});

// ---- Patches to charts: each becomes a disc, and neighbours are glued together as long as the result can lie flat
// with little stretch (merging.cc).

// `disc` tells the disc, in [0, count), that each face belongs to, -1 for those to leave alone; on return they are
// numbered in the order of their lowest faces. Glues discs along their borders: first where a border is most of a
// disc's outline and bends least, as long as the estimated stretch of the union stays below max_stretch (or no higher
// than that of the parts, where these are above it already). Limits above AtlasTuning::first_stretch are reached in
// steps. O(F log F) work for estimates, which start from `kept` and leave there what they have come to
// (StretchEstimate::TakeKept()).
// After a stop request it leaves the discs as they are by then. Of no use after a cancellation.
void MergeDiscs(std::int32_t count, double max_stretch, const AtlasTuning& tuning, const Execution& execution,
                Gluing* gluing, std::vector<std::int32_t>* disc, std::vector<float>* kept);

// Makes a disc of the connected piece of face `start`, the faces with its number in `piece`, none of which may be glued
// yet. Marks them in `seen`, where none may be marked before. O(n) in its faces.
void GluePiece(std::int32_t start, const std::vector<std::int32_t>& piece, std::vector<char>* seen, Gluing* gluing);

// Makes a disc of every piece, whatever its holes and handles, and nothing else.
void GluePieces(const std::vector<std::int32_t>& piece, Gluing* gluing);

// ---- Outlines without teeth (smoothing.cc).

// Hands single faces over to the disc across (or across a slit of the same one), again and again, wherever that makes
// seams shorter: a discrete curve-shortening flow, stopped after some sweeps so that seams stay about where they are.
// Seams along bends count as shorter. Discs stay discs, of the same number; no vertex of an outline opens wider than
// AtlasTuning::widest. `chart`, per face of the surface, has the disc of each of `faces` and follows; -1 for faces that
// stay, which all faces beside `faces` must be. O(n) in `faces`. Of no use after a cancellation.
void SmoothOutlines(const AtlasTuning& tuning, const Execution& execution, std::vector<std::int32_t> faces,
                    Gluing* gluing, std::vector<std::int32_t>* chart);

// ---- Other neighbours where more than two faces meet, once there are charts (rejoining.cc).

// Import joins half-edges at crowded edges (Surface::crowded_edges) before anything is known about charts, and charts
// end at many of these edges all the same. There the half-edges are free for others: returned are pairs of them, by
// corner, that were not joined before and belong to two charts, so that a chart may go on where it had to end. The
// smallest charts come first, then pairs that bend least. `chart`: per face, that of the gluing; -1 for faces without
// one. O(n) in the half-edges at crowded edges, of which at most 64 lie on one.
std::vector<std::array<std::int32_t, 2>> PairsToRejoin(const Gluing& gluing, const std::vector<std::int32_t>& chart);

}  // namespace planish
