#include "core/mesh/near_symmetry.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "Eigen/Eigenvalues"
#include "Eigen/Geometry"
#include "core/base/radix_sort.h"
#include "core/mesh/ray_scene.h"

namespace planish {
namespace {

// Lengths are in diagonals of the mesh.
constexpr double kNear = 0.015, kNearCosine = 0.7;       // of a place of the surface and its mirror image
constexpr double kLeastNear = 0.95;                      // least share of the samples that are near
constexpr double kFarthestPair = 0.1, kAnyCosine = 0.3;  // for pairs of places to which the plane is fitted
constexpr double kReach = 0.05;                          // from the mirror image of a face to the face that is like it
// Samples and steps for all candidates, and for the best one.
constexpr int kFewPlaces = 80, kFewFits = 4, kPlaces = 300, kFits = 8;

struct Plane {
  Vec3 normal = Vec3::UnitX();  // of length 1
  double place = 0;             // along the normal

  Vec3 Image(const Vec3& p) const { return p - 2 * (p.dot(normal) - place) * normal; }
  Vec3 ImageOfDirection(const Vec3& d) const { return d - 2 * d.dot(normal) * normal; }
};

Vec3 ToVec3(const rays::Point& p) {
  return {p[0], p[1], p[2]};
}

rays::Point ToPoint(const Vec3& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

// The place of a triangle nearest to a point (Ericson 2005).
Vec3 NearestOf(const std::array<rays::Point, 3>& triangle, const Vec3& p) {
  const Vec3 a = ToVec3(triangle[0]), b = ToVec3(triangle[1]), c = ToVec3(triangle[2]);
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double sum = va + vb + vc;
  return sum > 0 ? Vec3(a + vb / sum * ab + vc / sum * ac) : a;
}

// The places of a surface, in units of its diagonal.
class Places {
 public:
  Places(const Mesh& mesh, const RayScene& scene) : scene_(scene), normal_(scene.faces.size()) {
    for (std::size_t i = 0; i < normal_.size(); ++i) {
      const auto [a, b, c] = TriangleOf(mesh.positions, mesh.faces[scene.faces[i]]);
      const Vec3 area = ((b - a) / (2 * scene.half)).cross((c - a) / (2 * scene.half));
      area_ += area.norm();
      so_far_.push_back(area_);
      normal_[i] = area.norm() > 0 ? Vec3(area.normalized()) : Vec3(Vec3::Zero());
    }
  }

  double area() const { return area_; }

  struct Place {
    std::size_t triangle = 0;  // of the scene
    Vec3 at = Vec3::Zero(), normal = Vec3::Zero();
  };

  // Places that are spread evenly over the area.
  std::vector<Place> Samples(int count) const {
    std::vector<Place> samples;
    for (int k = 0; k < count; ++k) {
      const double wanted = area_ * (k + 0.5) / count;
      const auto i = std::min<std::size_t>(std::lower_bound(so_far_.begin(), so_far_.end(), wanted) - so_far_.begin(),
                                           so_far_.size() - 1);
      constexpr double kOne = 0.7548776662466927, kTwo = 0.5698402909980532;  // fractions of the plastic number
      double u = k * kOne - std::floor(k * kOne), v = k * kTwo - std::floor(k * kTwo);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const std::array<rays::Point, 3>& triangle = scene_.solid->triangle(i);
      const Vec3 a = ToVec3(triangle[0]), b = ToVec3(triangle[1]), c = ToVec3(triangle[2]);
      samples.push_back({i, a + u * (b - a) + v * (c - a), normal_[i]});
    }
    return samples;
  }

  // The place nearest to a point among those whose normal has this cosine with `normal`. The search is faster with a
  // `guess`, a place that may be near.
  std::optional<Place> Nearest(const Vec3& p, const Vec3& normal, double reach, double cosine,
                               const std::optional<Place>& guess = {}) const {
    std::optional<Place> nearest;
    double least = reach * reach;
    const auto look = [&](std::size_t i) {
      if (!(normal_[i].dot(normal) >= cosine)) return false;
      const Vec3 at = NearestOf(scene_.solid->triangle(i), p);
      const double squared = (at - p).squaredNorm();
      if (!(squared < least || (nearest && squared == least && i < nearest->triangle))) return false;
      least = squared;
      nearest = {i, at, normal_[i]};
      return true;
    };
    if (guess) look(guess->triangle);
    scene_.solid->ForEachNear(ToPoint(p), static_cast<float>(std::sqrt(least)), [&](std::size_t i, float* left) {
      if (look(i)) *left = static_cast<float>(std::sqrt(least));
    });
    return nearest;
  }

 private:
  const RayScene& scene_;
  std::vector<Vec3> normal_;
  std::vector<double> so_far_;  // area of this triangle and those before
  double area_ = 0;
};

struct FittedPlane {
  Plane plane;
  double share = 0;
};

// Moves a plane to where the samples lie nearest to their mirror images (iterated closest points). Gives up, with a
// share of 0, if they do not come near.
FittedPlane Fit(const Places& places, const std::vector<Places::Place>& samples, int fits, Plane plane) {
  constexpr double kLeastOfAll = 0.5;  // of the samples, for a plane that is looked at further
  for (int fit = 0; fit < fits; ++fit) {
    struct TwoPlaces {
      double distance;
      std::size_t sample;
      Vec3 at;
    };
    std::vector<TwoPlaces> pairs;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const Vec3 image = plane.Image(samples[k].at);
      const auto nearest = places.Nearest(image, plane.ImageOfDirection(samples[k].normal), kFarthestPair, kAnyCosine);
      if (nearest) pairs.push_back({(nearest->at - image).norm(), k, nearest->at});
    }
    if (static_cast<double>(pairs.size()) < kLeastOfAll * static_cast<double>(samples.size())) return {};
    std::sort(pairs.begin(), pairs.end(), [](const TwoPlaces& a, const TwoPlaces& b) {
      return a.distance != b.distance ? a.distance < b.distance : a.sample < b.sample;
    });
    constexpr double kTrimmed = 0.85;  // share of the pairs that count
    pairs.resize(static_cast<std::size_t>(kTrimmed * static_cast<double>(pairs.size())));
    Vec3 from = Vec3::Zero(), to = Vec3::Zero();
    for (const TwoPlaces& pair : pairs) {
      from += samples[pair.sample].at;
      to += pair.at;
    }
    from /= static_cast<double>(pairs.size());
    to /= static_cast<double>(pairs.size());
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    for (const TwoPlaces& pair : pairs) products += (samples[pair.sample].at - from) * (pair.at - to).transpose();
    const Eigen::Matrix3d both = products + products.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(both);
    Vec3 normal = solver.eigenvectors().col(0);
    if (normal.dot(plane.normal) < 0) normal = -normal;
    const Plane next = {normal, normal.dot(from + to) / 2};
    constexpr double kStill = 1e-4;
    const bool is_still = (next.normal - plane.normal).norm() < kStill && std::abs(next.place - plane.place) < kStill;
    plane = next;
    if (is_still) break;
  }
  std::size_t near = 0;
  for (const Places::Place& sample : samples) {
    near += places.Nearest(plane.Image(sample.at), plane.ImageOfDirection(sample.normal), kNear, kNearCosine) ? 1 : 0;
  }
  return {plane, static_cast<double>(near) / static_cast<double>(samples.size())};
}

// The plane with the most area near its mirror image.
FittedPlane FindPlane(const Places& places, const Execution& execution) {
  const std::vector<Places::Place> samples = places.Samples(kPlaces), few = places.Samples(kFewPlaces);
  Vec3 centre = Vec3::Zero(), low = samples[0].at, high = low;
  for (const Places::Place& sample : samples) {
    centre += sample.at / static_cast<double>(samples.size());
    low = low.cwiseMin(sample.at);
    high = high.cwiseMax(sample.at);
  }
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (const Places::Place& sample : samples) {
    products += (sample.at - centre) * (sample.at - centre).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(products);
  constexpr double kWorthFitting = 0.8;  // least share of the few samples
  FittedPlane best;
  for (const bool are_axes : {true, false}) {
    for (int k = 0; k < 3; ++k) {
      const Vec3 normal = are_axes ? Vec3(Vec3::Unit(k)) : Vec3(solver.eigenvectors().col(k));
      if (execution.IsCancelled()) return best;
      const Vec3 through = are_axes ? Vec3((low + high) / 2) : centre;
      const FittedPlane fitted = Fit(places, few, kFewFits, {normal, normal.dot(through)});
      constexpr double kBetter = 0.02;
      if (fitted.share > best.share + kBetter) best = fitted;
    }
    if (best.share >= kWorthFitting) break;
  }
  return best.share < kWorthFitting ? best : Fit(places, samples, kFits, best.plane);
}

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
  const Places places(mesh, *scene);
  if (!(places.area() > 0) || !std::isfinite(places.area())) return std::nullopt;
  const FittedPlane found = FindPlane(places, execution);
  const Plane& plane = found.plane;
  const double share = found.share;
  if (share < kLeastNear || execution.IsCancelled()) return std::nullopt;
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
  folded.share = share;
  folded.mesh = Cutter(mesh, polygon, positions).Run(&folded.polygon);
  if (2 * folded.mesh.num_faces() > most_faces) {
    folded.mesh = Simplify(folded.mesh, most_faces / 2);
    folded.polygon = Indices(folded.mesh.faces.size());
  }
  const std::optional<RayScene> side = MakeRayScene(folded.mesh, execution);
  if (!side || execution.IsCancelled()) return std::nullopt;
  const Places places_of_side(folded.mesh, *side);
  const auto half = static_cast<std::int32_t>(folded.mesh.num_faces());
  folded.like.assign(mesh.faces.size(), -1);
  constexpr std::int64_t kChunk = 256;
  execution.For(
      std::ssize(scene->faces),
      [&](std::int64_t begin, std::int64_t end) {
        std::optional<Places::Place> near;  // found for the last face, which is often near
        for (std::int64_t i = begin; i < end; ++i) {
          const std::int32_t f = scene->faces[i];
          const auto [a, b, c] = TriangleOf(positions, mesh.faces[f]);
          Vec3 middle = (a + b + c) / 3, normal = (b - a).cross(c - a).normalized();
          const bool is_image = middle.x() > 0;
          if (is_image) {
            middle.x() = -middle.x();
            normal.x() = -normal.x();
          }
          near = places_of_side.Nearest(ToVec3(side->PointAt(middle)), normal, kReach / (2 * side->half), kAnyCosine,
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
