// Patches to charts: each becomes a disc, and neighbours are glued together as long as the result can lie flat with
// little stretch.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/tuning.h"

namespace planish {

// `disc` tells the disc, in [0, count), that each face belongs to, -1 for those to leave alone; on return they are
// numbered in the order of their lowest faces. Glues discs along stretches of their outlines: first where the stretch
// is the longest part of a disc's outline and bends least, as long as the estimated stretch of the union stays below
// max_stretch (or no higher than that of the parts, where these are above it already). O(F log F) work for estimates.
// After a stop request it leaves the discs as they are by then. Of no use after a cancellation.
void MergeDiscs(std::int32_t count, double max_stretch, const AtlasTuning& tuning, const Execution& execution,
                Gluing* gluing, std::vector<std::int32_t>* disc);

// Makes a disc of the connected piece of face `start`, the faces with its number in `piece`, none of which may be glued
// yet. Marks them in `seen`, where none may be marked before. O(n) in its faces.
void GluePiece(std::int32_t start, const std::vector<std::int32_t>& piece, std::vector<char>* seen, Gluing* gluing);

// Makes a disc of every piece, whatever its holes and handles, and nothing else.
void GluePieces(const std::vector<std::int32_t>& piece, Gluing* gluing);

}  // namespace planish
