#include "core/charts/segmentation.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "core/charts/merging.h"
#include "core/charts/patches.h"
#include "core/charts/smoothing.h"

namespace planish {
namespace {

// The connected pieces of faces with equal labels, numbered by their lowest faces; -1 where `label` is.
std::vector<std::int32_t> ConnectedPieces(const Surface& surface, const std::vector<std::int32_t>& faces,
                                          const std::vector<std::int32_t>& label, std::int32_t* count) {
  std::vector<std::int32_t> piece(label.size(), -1), stack;
  for (const std::int32_t start : faces) {
    if (piece[start] >= 0 || label[start] < 0) continue;
    piece[start] = (*count)++;
    stack.push_back(start);
    while (!stack.empty()) {
      const std::int32_t f = stack.back();
      stack.pop_back();
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        const std::int32_t o = surface.across[c];
        if (o < 0 || piece[o / 3] >= 0 || label[o / 3] != label[f]) continue;
        piece[o / 3] = piece[f];
        stack.push_back(o / 3);
      }
    }
  }
  return piece;
}

Vec3 Centre(const Surface& surface, std::int32_t f) {
  const auto& [a, b, c] = surface.mesh->faces[f];
  return (surface.mesh->positions[a] + surface.mesh->positions[b] + surface.mesh->positions[c]) / 3;
}

// Distances within a chart, from face centre to face centre, without crossing its slits. Faces that must not be parted
// are one place.
class Distances {
 public:
  explicit Distances(const Gluing& gluing)
      : gluing_(gluing), distance_(gluing.surface().num_faces(), kFar), source_(distance_.size(), -1) {}

  // From the nearest of `sources`, the first one of several, to all faces of their chart.
  void From(const std::vector<std::int32_t>& sources) {
    using Entry = std::pair<Nearness, std::int32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    const auto reach = [&](const Nearness& there, std::int32_t f) {
      if (!(there < At(f))) return;
      distance_[f] = there.first;
      source_[f] = there.second;
      queue.emplace(there, f);
    };
    for (std::size_t i = 0; i < sources.size(); ++i) reach({0.0, static_cast<std::int32_t>(i)}, sources[i]);
    while (!queue.empty()) {
      const auto [nearness, f] = queue.top();
      queue.pop();
      if (At(f) < nearness) continue;
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        const std::int32_t o = gluing_.opposite()[c];
        if (o < 0) continue;
        const Surface& surface = gluing_.surface();
        const double step = surface.is_uncut(c) ? 0 : (Centre(surface, f) - Centre(surface, o / 3)).norm();
        reach({nearness.first + step, nearness.second}, o / 3);
      }
    }
  }

  // The farthest of these faces, the lowest of several.
  std::int32_t Farthest(const std::vector<std::int32_t>& faces) const {
    return *std::max_element(faces.begin(), faces.end(),
                             [&](std::int32_t f, std::int32_t g) { return distance_[f] < distance_[g]; });
  }
  // Which of the sources is nearest, as an index.
  std::int32_t source(std::int32_t f) const { return source_[f]; }

  void Forget(const std::vector<std::int32_t>& faces) {
    for (const std::int32_t f : faces) distance_[f] = kFar;
  }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  using Nearness = std::pair<double, std::int32_t>;  // distance, source
  Nearness At(std::int32_t f) const { return {distance_[f], source_[f]}; }

  const Gluing& gluing_;
  std::vector<double> distance_;
  std::vector<std::int32_t> source_;
};

// Which half of a chart each of its faces belongs to, 0 or 1: with the nearer one of two faces, or, if these are
// -1 or cannot be parted, of two about as far from each other as faces of this chart can be. All 0 if no face can
// be parted from another.
std::vector<std::int32_t> Halve(const std::vector<std::int32_t>& faces, std::int32_t face, std::int32_t other_face,
                                Distances* distances) {
  std::vector<std::int32_t> half(faces.size());
  const auto part = [&](std::int32_t first, std::int32_t second) {
    distances->From({first, second});
    for (std::size_t i = 0; i < faces.size(); ++i) half[i] = distances->source(faces[i]) == 1 ? 1 : 0;
    distances->Forget(faces);
    return std::find(half.begin(), half.end(), 1) != half.end();
  };
  if (face >= 0 && part(face, other_face)) return half;
  const auto farthest_from = [&](std::int32_t f) {
    distances->From({f});
    const std::int32_t farthest = distances->Farthest(faces);
    distances->Forget(faces);
    return farthest;
  };
  const std::int32_t first = farthest_from(faces.front());
  part(first, farthest_from(first));
  return half;
}

}  // namespace

Segmentation::Segmentation(const Surface& surface, Kind kind, double max_stretch, const Execution& execution)
    : surface_(surface), gluing_(surface) {
  std::vector<std::int32_t> taking_part(surface.num_faces()), label(surface.num_faces(), -1);
  std::iota(taking_part.begin(), taking_part.end(), 0);
  for (const std::int32_t f : taking_part) label[f] = surface.takes_part[f] ? 0 : -1;
  if (kind == Kind::kWhole) {
    std::int32_t count = 0;
    chart_ = ConnectedPieces(surface, taking_part, label, &count);
    GluePieces(chart_, &gluing_);
  } else {
    chart_ = MakePatches(surface, execution);
    if (execution.IsStopped()) return;
    const std::int32_t count = chart_.empty() ? 0 : *std::max_element(chart_.begin(), chart_.end()) + 1;
    MergePieces(count, max_stretch, execution, &gluing_, &chart_);
    SmoothOutlines(execution, &gluing_, &chart_);
  }
  CollectFaces();
}

void Segmentation::CollectFaces() {
  faces_.clear();
  for (std::int32_t f = 0; f < surface_.num_faces(); ++f) {
    if (chart_[f] < 0) continue;
    if (chart_[f] >= static_cast<std::int32_t>(faces_.size())) faces_.resize(chart_[f] + 1);
    faces_[chart_[f]].push_back(f);
  }
}

bool Segmentation::HasSlit(std::int32_t chart) const {
  for (const std::int32_t f : faces_[chart]) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      const std::int32_t o = surface_.across[c];
      if (o >= 0 && gluing_.IsOutline(c) && chart_[o / 3] == chart) return true;
    }
  }
  return false;
}

bool Segmentation::IsDisc(const std::vector<std::int32_t>& faces) const {
  const std::vector<std::int32_t>& opposite = gluing_.opposite();
  // Euler's characteristic. A vertex counts at the corner that comes last counter-clockwise, on the outline, or that
  // has the lowest number, inside.
  std::int64_t vertices = 0, glued = 0;
  for (const std::int32_t f : faces) {
    for (int k = 0; k < 3; ++k) {
      glued += opposite[3 * f + k] >= 0;
      const std::int32_t start = 3 * f + k;
      bool counts = true;
      for (std::int32_t c = start;;) {
        const std::int32_t o = opposite[3 * (c / 3) + Next(c % 3)];
        if (o < 0) {
          counts = c == start;
          break;
        }
        c = 3 * (o / 3) + Next(o % 3);
        if (c <= start) {
          counts = c == start;
          break;
        }
      }
      vertices += counts;
    }
  }
  const auto num_faces = static_cast<std::int64_t>(faces.size());
  return vertices - (3 * num_faces - glued / 2) + num_faces == 1;
}

std::vector<std::int32_t> Segmentation::Split(const std::vector<Cut>& cuts, const Execution& execution) {
  Distances distances(gluing_);
  std::vector<std::int32_t> changed;
  for (const auto& [chart, face, other_face, given] : cuts) {
    if (faces_[chart].size() < 2 || execution.IsStopped()) continue;
    const std::vector<std::int32_t> faces = faces_[chart];
    const std::vector<std::int32_t> part = given.empty() ? Halve(faces, face, other_face, &distances) : given;
    const std::int32_t last = *std::max_element(part.begin(), part.end());
    if (last == 0) continue;
    const auto added = static_cast<std::int32_t>(faces_.size());
    faces_.resize(faces_.size() + last);
    faces_[chart].clear();
    for (std::size_t i = 0; i < faces.size(); ++i) {
      chart_[faces[i]] = part[i] == 0 ? chart : added + part[i] - 1;
      faces_[chart_[faces[i]]].push_back(faces[i]);
    }
    for (const std::int32_t f : faces) {
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        if (!gluing_.IsOutline(c) && chart_[gluing_.opposite()[c] / 3] != chart_[f]) gluing_.Unglue(c);
      }
    }
    for (std::int32_t k = 0; k <= last; ++k) {
      const std::int32_t number = k == 0 ? chart : added + k - 1;
      changed.push_back(number);
      if (IsDisc(faces_[number])) continue;
      // It runs round another part.
      for (const std::int32_t f : faces_[number]) {
        for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
          if (!gluing_.IsOutline(c)) gluing_.Unglue(c);
        }
      }
      std::vector<std::int32_t> piece(chart_.size(), -1);
      for (const std::int32_t f : faces_[number]) piece[f] = 0;
      GluePieces(piece, &gluing_);
    }
  }
  std::vector<char> is_changed(faces_.size(), 0);
  for (const std::int32_t i : changed) is_changed[i] = 1;
  std::vector<std::int32_t> moving(chart_.size(), -1);
  for (std::size_t f = 0; f < moving.size(); ++f) moving[f] = chart_[f] >= 0 && is_changed[chart_[f]] ? chart_[f] : -1;
  SmoothOutlines(execution, &gluing_, &moving);
  for (std::size_t f = 0; f < moving.size(); ++f) {
    if (moving[f] >= 0) chart_[f] = moving[f];
  }
  CollectFaces();
  std::sort(changed.begin(), changed.end());
  return changed;
}

}  // namespace planish
