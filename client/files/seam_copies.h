// Vertices that PLY and OFF files hold several times. Both have one UV per vertex, so a vertex on a seam is written as
// several. A reader that took them for different vertices would find a hole in the surface along every seam. Used
// inside client/files only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "client/files/polygon_mesh.h"
#include "core/base/corner_split.h"

namespace planish {

// Makes one vertex again of those that a writer had to split. `mesh` is as the file has it, with UV of vertices.
//
// Files that planish wrote tell in comments which of their vertices are copies (SeamMarks()). `marks` are the comments
// that IsSeamMark() finds. The copies are left out of `mesh`: the surface is the one that was written, and vertices
// that lay at one place before stay apart. Of other files, or if the marks do not fit the vertices, all vertices at the
// same position (to the bit) are one, as in a glTF; PolygonMesh::corner_file_vertex then has the file's own.
void JoinSeamVertices(const std::vector<std::string_view>& marks, PolygonMesh* mesh);

// Whether a comment of a file, without what introduces it, is such a mark.
bool IsSeamMark(std::string_view comment);

// The file's vertices with one UV each: SplitCorners() of the corners as the file has them.
CornerSplit SplitForFile(const PolygonMesh& mesh, const std::vector<double>& corner_uv);

// The comments that tell JoinSeamVertices() which vertices of the split are copies; none where it would find the same
// surface without.
std::vector<std::string> SeamMarks(const PolygonMesh& mesh, const CornerSplit& split);

}  // namespace planish
