// Duplicate vertices in PLY and OFF files. Both formats have one UV per vertex, so a vertex on a seam is written
// several times. A reader that took these for different vertices would find a hole in the surface along every seam.
// Used only in client/files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "client/files/polygon_mesh.h"
#include "core/base/corner_split.h"

namespace planish {

// Joins vertices that a writer had to split. `mesh` is as in the file, with UV of vertices.
//
// Files written by planish list in comments which of their vertices are copies (SeamMarks()). `marks` are the comments
// that IsSeamMark() accepts. The copies are removed from `mesh`: the surface is the one that was written, and vertices
// that were at the same position before stay apart. For other files, or if the marks do not match the vertices, all
// vertices at the same position (to the bit) become one, as in a glTF; PolygonMesh::corner_file_vertex then has the
// file's own vertices.
void JoinSeamVertices(const std::vector<std::string_view>& marks, PolygonMesh* mesh);

// Whether a comment, given without its introducing characters, is one of those that mark copies (SeamMarks()).
bool IsSeamMark(std::string_view comment);

// Splits the file's vertices so that each has one UV (SplitCorners() in core/base/corner_split.h).
CornerSplit SplitForFile(const PolygonMesh& mesh, const std::vector<double>& corner_uv);

// The comments from which JoinSeamVertices() learns which vertices of the split are copies; none if JoinSeamVertices()
// would find the same surface without them.
std::vector<std::string> SeamMarks(const PolygonMesh& mesh, const CornerSplit& split);

}  // namespace planish
