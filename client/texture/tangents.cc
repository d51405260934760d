#include "client/texture/tangents.h"

#include <cmath>
#include <cstddef>

#include "client/texture/mikktspace/mikktspace.h"

namespace planish {
namespace {

struct TangentWork {
  const TangentCorners& corners;
  std::vector<std::array<float, 4>> tangents;
};

TangentWork& WorkOf(const SMikkTSpaceContext* context) {
  return *static_cast<TangentWork*>(context->m_pUserData);
}

std::size_t CornerOf(int face, int vertex) {
  return 3 * static_cast<std::size_t>(face) + static_cast<std::size_t>(vertex);
}

template <std::size_t kCount>
void CopyFinite(const std::array<float, kCount>& from, float* to) {
  for (std::size_t i = 0; i < kCount; ++i) to[i] = std::isfinite(from[i]) ? from[i] : 0;
}

}  // namespace

std::vector<std::array<float, 4>> ComputeTangents(const TangentCorners& corners) {
  TangentWork work = {corners, std::vector<std::array<float, 4>>(corners.positions.size(), {1, 0, 0, 1})};
  if (corners.positions.empty()) return work.tangents;
  SMikkTSpaceInterface calls = {};
  calls.m_getNumFaces = [](const SMikkTSpaceContext* context) {
    return static_cast<int>(WorkOf(context).corners.positions.size() / 3);
  };
  calls.m_getNumVerticesOfFace = [](const SMikkTSpaceContext*, int) { return 3; };
  calls.m_getPosition = [](const SMikkTSpaceContext* context, float* out, int face, int vertex) {
    CopyFinite(WorkOf(context).corners.positions[CornerOf(face, vertex)], out);
  };
  calls.m_getNormal = [](const SMikkTSpaceContext* context, float* out, int face, int vertex) {
    CopyFinite(WorkOf(context).corners.normals[CornerOf(face, vertex)], out);
  };
  calls.m_getTexCoord = [](const SMikkTSpaceContext* context, float* out, int face, int vertex) {
    CopyFinite(WorkOf(context).corners.uv[CornerOf(face, vertex)], out);
  };
  calls.m_setTSpaceBasic = [](const SMikkTSpaceContext* context, const float* tangent, float sign, int face,
                              int vertex) {
    std::array<float, 4>& out = WorkOf(context).tangents[CornerOf(face, vertex)];
    const float length = std::hypot(tangent[0], tangent[1], tangent[2]);
    // A corner without area in the map gets no tangent: leaves (1, 0, 0), as any vector of length 1 will do.
    if (!(length > 0)) return;
    out = {tangent[0] / length, tangent[1] / length, tangent[2] / length, sign < 0 ? -1.0F : 1.0F};
  };
  SMikkTSpaceContext context = {&calls, &work};
  genTangSpaceDefault(&context);
  return work.tangents;
}

}  // namespace planish
