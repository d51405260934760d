#include "core/charts/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "Eigen/Geometry"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

Face Sorted(Face face) {
  std::sort(face.begin(), face.end());
  return face;
}

// How many earlier faces have the same three vertices.
std::vector<std::int32_t> Layers(const std::vector<Face>& faces) {
  std::vector<std::int32_t> order(faces.size()), layer(faces.size(), 0);
  std::iota(order.begin(), order.end(), 0);
  std::vector<Face> keys(faces.size());
  std::transform(faces.begin(), faces.end(), keys.begin(), Sorted);
  std::stable_sort(order.begin(), order.end(), [&](std::int32_t f, std::int32_t g) { return keys[f] < keys[g]; });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (keys[order[i]] == keys[order[i - 1]]) layer[order[i]] = layer[order[i - 1]] + 1;
  }
  return layer;
}

// Two faces of one edge are the same again if their third vertices are; only then are layers looked for.
bool HasCopies(const std::vector<Face>& faces, const EdgeGroups& edges, const Execution& execution) {
  return execution.Count(edges.num_edges(), [&](std::int64_t e) {
    const std::int32_t begin = edges.begin[e], end = edges.begin[e + 1];
    if (end - begin < 2) return false;
    if (end - begin > 2) return true;
    const std::int32_t c = edges.half_edge[begin], d = edges.half_edge[begin + 1];
    return faces[c / 3][c % 3] == faces[d / 3][d % 3];
  }) > 0;
}

void MeasureFlatFace(const Vec3 p[3], double angles[3]) {
  constexpr double kLonger = 1e-3;  // of the longest edge
  double length[3];                 // of the edge that each corner faces
  for (int k = 0; k < 3; ++k) length[k] = (p[Prev(k)] - p[Next(k)]).norm();
  const double longest = std::max({length[0], length[1], length[2]});
  for (double& l : length) l += kLonger * longest;
  // Place the triangle in the plane, for the accurate angles of small ones.
  const double x = (length[0] * length[0] + length[1] * length[1] - length[2] * length[2]) / (2 * length[0]);
  const double s = (length[0] + length[1] + length[2]) / 2;
  const double area = std::sqrt(std::max(0.0, s * (s - length[0]) * (s - length[1]) * (s - length[2])));
  // The edge faced by corner 0 from (0, 0), corner 2, to (length[0], 0), corner 1.
  const Vec2 q[3] = {Vec2(x, 2 * area / length[0]), Vec2(length[0], 0), Vec2(0, 0)};
  TriangleAngles(q, angles);
}

void MeasureFaces(const Execution& execution, Surface* surface) {
  const Mesh& mesh = *surface->mesh;
  const std::int32_t num_faces = static_cast<std::int32_t>(mesh.num_faces());
  surface->takes_part.assign(num_faces, 1);
  surface->is_flat.assign(num_faces, 0);
  surface->angle.assign(3 * static_cast<std::size_t>(num_faces), 0.0);
  surface->area.assign(num_faces, 0.0);
  surface->area_normal.assign(num_faces, Vec3::Zero());
  execution.For(num_faces, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t f = begin; f < end; ++f) {
      const auto& [a, b, c] = mesh.faces[f];
      if (a == b || b == c || c == a) {
        surface->takes_part[f] = 0;
        continue;
      }
      const Vec3 p[3] = {mesh.positions[a], mesh.positions[b], mesh.positions[c]};
      if (p[0] == p[1] && p[1] == p[2]) {
        surface->takes_part[f] = 0;
        continue;
      }
      surface->area_normal[f] = (p[1] - p[0]).cross(p[2] - p[0]) / 2;
      surface->area[f] = surface->area_normal[f].norm();
      surface->is_flat[f] = IsDegenerateTriangle(p[0], p[1], p[2]);
      double* angles = &surface->angle[3 * f];
      if (surface->is_flat[f]) {
        MeasureFlatFace(p, angles);
      } else {
        TriangleAngles(p, angles);
      }
    }
  });
}

// Whether the normals of two neighbours are further apart than the angle of this cosine. Faces without area have none.
bool IsHard(const Surface& surface, std::int32_t f, std::int32_t g, double cosine) {
  if (surface.is_flat[f] || surface.is_flat[g]) return false;
  return surface.area_normal[f].dot(surface.area_normal[g]) < cosine * surface.area[f] * surface.area[g];
}

}  // namespace

Surface MakeSurface(const Mesh& mesh, const GivenSeams& seams, const Execution& execution) {
  Surface surface;
  surface.mesh = &mesh;
  MeasureFaces(execution, &surface);
  surface.across.assign(3 * mesh.faces.size(), -1);

  // Faces that name a vertex twice have edges as well, but no neighbours.
  std::vector<Face> faces = mesh.faces;
  std::vector<std::int32_t> face_id;
  const bool all_take_part =
      std::all_of(surface.takes_part.begin(), surface.takes_part.end(), [](char c) { return c; });
  if (!all_take_part) {
    faces.clear();
    for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
      if (!surface.takes_part[f]) continue;
      face_id.push_back(f);
      faces.push_back(mesh.faces[f]);
    }
  }
  const auto in_mesh = [&](std::int32_t c) { return all_take_part ? c : 3 * face_id[c / 3] + c % 3; };

  const EdgeGroups edges = GroupHalfEdges(faces, mesh.num_vertices(), execution);
  if (execution.IsStopped()) return surface;
  const std::vector<std::int32_t> layer =
      HasCopies(faces, edges, execution) ? Layers(faces) : std::vector<std::int32_t>(faces.size(), 0);
  std::vector<std::int32_t> members;
  for (std::int32_t e = 0; e < edges.num_edges(); ++e) {
    members.assign(edges.half_edge.begin() + edges.begin[e], edges.half_edge.begin() + edges.begin[e + 1]);
    if (members.size() < 2) continue;
    if (members.size() > 2) {
      std::stable_sort(members.begin(), members.end(),
                       [&](std::int32_t c, std::int32_t d) { return layer[c / 3] < layer[d / 3]; });
    }
    for (std::size_t begin = 0, end; begin < members.size(); begin = end) {
      end = begin + 1;
      while (end < members.size() && layer[members[end] / 3] == layer[members[begin] / 3]) ++end;
      if (end - begin > 2) ++surface.non_manifold_edges;
      if (end - begin != 2) continue;
      const std::int32_t c = members[begin], d = members[begin + 1];
      if (Origin(faces, c) != Target(faces, d)) {
        ++surface.clashing_edges;
        continue;
      }
      surface.across[in_mesh(c)] = in_mesh(d);
      surface.across[in_mesh(d)] = in_mesh(c);
    }
  }

  const auto cut = [&](std::int32_t c) {
    const std::int32_t d = surface.across[c];
    if (d >= 0) surface.across[c] = surface.across[d] = -1;
  };
  for (const std::int32_t c : seams.corners) cut(c);
  if (!seams.uncut_corners.empty()) surface.uncut.assign(surface.across.size(), 0);
  for (const std::int32_t c : seams.uncut_corners) {
    const std::int32_t d = surface.across[c];
    if (d >= 0) surface.uncut[c] = surface.uncut[d] = 1;
  }
  if (seams.hard_edge_degrees > 0) {
    const double cosine = std::cos(seams.hard_edge_degrees * std::numbers::pi / 180);
    for (std::int32_t c = 0; c < 3 * surface.num_faces(); ++c) {
      const std::int32_t d = surface.across[c];
      if (d > c && !surface.is_uncut(c) && IsHard(surface, c / 3, d / 3, cosine)) cut(c);
    }
  }
  return surface;
}

}  // namespace planish
