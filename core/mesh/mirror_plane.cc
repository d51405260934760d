#include "core/mesh/mirror_plane.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "Eigen/Eigenvalues"

namespace planish {
namespace {

constexpr double kFarthestPair = 0.1, kPairCosine = 0.3;  // for pairs of places to which the plane is fitted
// Samples and steps for all candidates, and for the best one.
constexpr int kFewPlaces = 80, kFewFits = 4, kPlaces = 300, kFits = 8;

// Moves a plane to where the samples lie nearest to their mirror images (iterated closest points). Gives up, with a
// share of 0, if they do not come near.
MirrorPlane Fit(const SurfacePlaces& places, const std::vector<SurfacePlaces::Place>& samples, int fits,
                MirrorPlane plane) {
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
      const auto nearest = places.Nearest(image, plane.ImageOfDirection(samples[k].normal), kFarthestPair, kPairCosine);
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
    const MirrorPlane next = {normal, normal.dot(from + to) / 2};
    constexpr double kStill = 1e-4;
    const bool is_still = (next.normal - plane.normal).norm() < kStill && std::abs(next.place - plane.place) < kStill;
    plane = next;
    if (is_still) break;
  }
  std::size_t near = 0;
  for (const SurfacePlaces::Place& sample : samples) {
    near += places.Nearest(plane.Image(sample.at), plane.ImageOfDirection(sample.normal), kNearImage, kNearImageCosine)
                ? 1
                : 0;
  }
  plane.share = static_cast<double>(near) / static_cast<double>(samples.size());
  return plane;
}

}  // namespace

MirrorPlane FindMirrorPlane(const SurfacePlaces& places, const Execution& execution) {
  const std::vector<SurfacePlaces::Place> samples = places.Samples(kPlaces), few = places.Samples(kFewPlaces);
  Vec3 centre = Vec3::Zero(), low = samples[0].at, high = low;
  for (const SurfacePlaces::Place& sample : samples) {
    centre += sample.at / static_cast<double>(samples.size());
    low = low.cwiseMin(sample.at);
    high = high.cwiseMax(sample.at);
  }
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (const SurfacePlaces::Place& sample : samples) {
    products += (sample.at - centre) * (sample.at - centre).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(products);
  constexpr double kWorthFitting = 0.8;  // least share of the few samples
  MirrorPlane best;
  for (const bool are_axes : {true, false}) {
    for (int k = 0; k < 3; ++k) {
      const Vec3 normal = are_axes ? Vec3(Vec3::Unit(k)) : Vec3(solver.eigenvectors().col(k));
      if (execution.IsCancelled()) return best;
      const Vec3 through = are_axes ? Vec3((low + high) / 2) : centre;
      const MirrorPlane fitted = Fit(places, few, kFewFits, {normal, normal.dot(through)});
      constexpr double kBetter = 0.02;
      if (fitted.share > best.share + kBetter) best = fitted;
    }
    if (best.share >= kWorthFitting) break;
  }
  return best.share < kWorthFitting ? best : Fit(places, samples, kFits, best);
}

}  // namespace planish
