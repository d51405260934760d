#include "core/mesh/near_symmetry.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "Eigen/Geometry"
#include "core/base/radix_sort.h"
#include "core/mesh/mirror_plane.h"
#include "core/mesh/ray_scene.h"
#include "core/mesh/surface_places.h"

namespace planish {
namespace {

constexpr double kLeastNear = 0.95;  // least share of the area that lies near its mirror image
// From the mirror image of a face to the face that is like it: in diagonals of the mesh, and between the normals.
constexpr double kReach = 0.05, kLikeCosine = 0.3;

// Cuts a mesh at a plane, and keeps one side.
class Cutter {
 public:
  // `x`: per vertex, its distance from the plane. The side of negative x stays.
  Cutter(const Mesh& mesh, const std::vector<std::int32_t>& polygon, std::vector<Vec3> positions)
      : mesh_(mesh), polygon_(polygon), positions_(std::move(positions)), number_(positions_.size(), -1) {
    Snap();
  }

  // Sets `polygon`: per face of the result, the polygon of the face that it is a part of.
  Mesh Run(std::vector<std::int32_t>* polygon) {
    for (std::int32_t f = 0; f < mesh_.num_faces(); ++f) {
      if (!mesh_.IsInRange(mesh_.faces[f])) continue;
      const std::vector<std::int32_t> corners = Clip(mesh_.faces[f]);
      for (std::size_t k = 1; k + 1 < corners.size(); ++k) {
        side_.faces.push_back({corners[0], corners[k], corners[k + 1]});
        polygon->push_back(polygon_.empty() ? f : polygon_[f]);
      }
    }
    return std::move(side_);
  }

 private:
  // Moves vertices to the plane where it cuts an edge near one of its ends.
  void Snap() {
    constexpr double kShort = 0.2;  // of an edge
    std::vector<char> is_near(positions_.size(), 0);
    for (const Face& face : mesh_.faces) {
      if (!mesh_.IsInRange(face)) continue;
      for (int k = 0; k < 3; ++k) {
        const std::int32_t v = face[k], w = face[Next(k)];
        const double a = positions_[v].x(), b = positions_[w].x();
        if (!(a * b < 0)) continue;
        if (std::abs(a) < kShort * std::abs(b - a)) is_near[v] = 1;
        if (std::abs(b) < kShort * std::abs(b - a)) is_near[w] = 1;
      }
    }
    for (std::size_t v = 0; v < is_near.size(); ++v) {
      if (is_near[v]) positions_[v].x() = 0;
    }
  }

  std::int32_t Add(const Vec3& p) {
    side_.positions.push_back(p);
    return static_cast<std::int32_t>(side_.positions.size()) - 1;
  }
  std::int32_t Number(std::int32_t v) {
    if (number_[v] < 0) number_[v] = Add(positions_[v]);
    return number_[v];
  }
  std::int32_t Crossing(std::int32_t v, std::int32_t w) {
    const auto [found, is_new] = crossing_.try_emplace(std::minmax(v, w), -1);
    if (!is_new) return found->second;
    const Vec3 &a = positions_[found->first.first], &b = positions_[found->first.second];
    Vec3 p = a + a.x() / (a.x() - b.x()) * (b - a);
    p.x() = 0;
    return found->second = Add(p);
  }

  // The corners of the part of a face that stays.
  std::vector<std::int32_t> Clip(const Face& face) {
    std::vector<std::int32_t> corners;
    const auto x = [&](std::int32_t v) { return positions_[v].x(); };
    if (std::none_of(face.begin(), face.end(), [&](std::int32_t v) { return x(v) < 0; })) return {};
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = face[k], w = face[Next(k)];
      if (x(v) <= 0) corners.push_back(Number(v));
      if ((x(v) < 0 && x(w) > 0) || (x(v) > 0 && x(w) < 0)) corners.push_back(Crossing(v, w));
    }
    return corners;
  }

  const Mesh& mesh_;
  const std::vector<std::int32_t>& polygon_;
  std::vector<Vec3> positions_;
  std::vector<std::int32_t> number_;  // per vertex: its number on the side that stays, or -1
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> crossing_;  // vertices where edges meet the plane
  Mesh side_;
};

// Simplifies a mesh to about `most` faces. Vertices with x = 0 keep it, if they lie on the boundary.
Mesh Simplify(const Mesh& mesh, std::int64_t most) {
  constexpr float kLargestError = 0.02F;  // of the size of the mesh
  std::vector<rays::Point> points;
  for (const Vec3& p : mesh.positions) points.push_back(ToPoint(p));
  std::vector<unsigned> corners;
  for (const Face& face : mesh.faces) corners.insert(corners.end(), face.begin(), face.end());
  corners.resize(meshopt_simplify(corners.data(), corners.data(), corners.size(), points.data()->data(), points.size(),
                                  sizeof(rays::Point), static_cast<std::size_t>(3 * most), kLargestError));
  Mesh simple;
  std::vector<std::int32_t> number(mesh.positions.size(), -1);
  for (std::size_t c = 0; c < corners.size(); ++c) {
    std::int32_t& v = number[corners[c]];
    if (v < 0) {
      v = static_cast<std::int32_t>(simple.positions.size());
      simple.positions.push_back(mesh.positions[corners[c]]);
    }
    if (c % 3 == 0) simple.faces.emplace_back();
    simple.faces.back()[c % 3] = v;
  }
  return simple;
}

// Adds the mirror image about x = 0 of all faces.
void AddMirrorImage(FoldedMesh* folded) {
  std::vector<Vec3>& positions = folded->mesh.positions;
  std::vector<Face>& faces = folded->mesh.faces;
  const auto vertices = static_cast<std::int32_t>(positions.size()), half = static_cast<std::int32_t>(faces.size());
  std::vector<std::int32_t> image(vertices);
  for (std::int32_t v = 0; v < vertices; ++v) {
    const Vec3 p = positions[v];
    image[v] = p.x() == 0 ? v : static_cast<std::int32_t>(positions.size());
    if (p.x() != 0) positions.emplace_back(-p.x(), p.y(), p.z());
  }
  // Polygons get the number of their first face.
  std::map<std::int32_t, std::int32_t> first;
  for (std::int32_t f = 0; f < half; ++f) {
    folded->polygon[f] = first.try_emplace(folded->polygon[f], f).first->second;
    faces.push_back({image[faces[f][0]], image[faces[f][2]], image[faces[f][1]]});
  }
  for (std::int32_t f = 0; f < half; ++f) folded->polygon.push_back(folded->polygon[f] + half);
}

}  // namespace

std::optional<FoldedMesh> FoldNearlySymmetric(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                              std::int64_t most_faces, const Execution& execution) {
  const bool are_finite =
      std::all_of(mesh.positions.begin(), mesh.positions.end(), [](const Vec3& p) { return p.allFinite(); });
  if (!are_finite) return std::nullopt;
  const std::optional<RayScene> scene = MakeRayScene(mesh, execution);
  if (!scene) return std::nullopt;
  const SurfacePlaces places(mesh, *scene);
  if (!(places.area() > 0) || !std::isfinite(places.area())) return std::nullopt;
  const MirrorPlane plane = FindMirrorPlane(places, execution);
  if (plane.share < kLeastNear || execution.IsCancelled()) return std::nullopt;
  // x along the normal of the plane, from the plane on.
  Vec3 y = plane.normal.cross(std::abs(plane.normal.x()) < 0.7 ? Vec3(Vec3::UnitX()) : Vec3(Vec3::UnitY()));
  y.normalize();
  const Vec3 z = plane.normal.cross(y);
  std::vector<Vec3> positions(mesh.positions.size());
  execution.ForEach(std::ssize(positions), [&](std::int64_t v) {
    const Vec3 p = (mesh.positions[v] / 2 - scene->low / 2) / scene->half;
    positions[v] = {plane.normal.dot(p) - plane.place, y.dot(p), z.dot(p)};
  });
  FoldedMesh folded;
  folded.share = plane.share;
  folded.mesh = Cutter(mesh, polygon, positions).Run(&folded.polygon);
  if (2 * folded.mesh.num_faces() > most_faces) {
    folded.mesh = Simplify(folded.mesh, most_faces / 2);
    folded.polygon = Indices(folded.mesh.faces.size());
  }
  const std::optional<RayScene> side = MakeRayScene(folded.mesh, execution);
  if (!side || execution.IsCancelled()) return std::nullopt;
  const SurfacePlaces places_of_side(folded.mesh, *side);
  const auto half = static_cast<std::int32_t>(folded.mesh.num_faces());
  folded.like.assign(mesh.faces.size(), -1);
  constexpr std::int64_t kChunk = 256;
  execution.For(
      std::ssize(scene->faces),
      [&](std::int64_t begin, std::int64_t end) {
        std::optional<SurfacePlaces::Place> near;  // found for the last face, which is often near
        for (std::int64_t i = begin; i < end; ++i) {
          const std::int32_t f = scene->faces[i];
          const auto [a, b, c] = TriangleOf(positions, mesh.faces[f]);
          Vec3 middle = (a + b + c) / 3, normal = (b - a).cross(c - a).normalized();
          const bool is_image = middle.x() > 0;
          if (is_image) {
            middle.x() = -middle.x();
            normal.x() = -normal.x();
          }
          near = places_of_side.Nearest(ToVec3(side->PointAt(middle)), normal, kReach / (2 * side->half), kLikeCosine,
                                        near);
          if (near) folded.like[f] = side->faces[near->triangle] + (is_image ? half : 0);
        }
      },
      kChunk);
  if (execution.IsCancelled()) return std::nullopt;
  AddMirrorImage(&folded);
  return folded;
}

}  // namespace planish
