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

// Distances within a chart, from face centre to face centre, without crossing its slits.
class Distances {
 public:
  explicit Distances(const Gluing& gluing)
      : gluing_(gluing), distance_(gluing.surface().num_faces(), kFar), source_(distance_.size(), -1) {}

  // From the nearest of `sources` to all faces of their chart; the one of them that it is.
  void From(const std::vector<std::int32_t>& sources) {
    using Entry = std::pair<double, std::int32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (const std::int32_t f : sources) {
      distance_[f] = 0;
      source_[f] = f;
      queue.emplace(0.0, f);
    }
    while (!queue.empty()) {
      const auto [distance, f] = queue.top();
      queue.pop();
      if (distance > distance_[f]) continue;
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        const std::int32_t o = gluing_.opposite()[c];
        if (o < 0) continue;
        const double there = distance + (Centre(gluing_.surface(), f) - Centre(gluing_.surface(), o / 3)).norm();
        if (!(there < distance_[o / 3])) continue;
        distance_[o / 3] = there;
        source_[o / 3] = source_[f];
        queue.emplace(there, o / 3);
      }
    }
  }

  // The farthest of these faces, the lowest of several; distances are forgotten.
  std::int32_t TakeFarthest(const std::vector<std::int32_t>& faces) {
    std::int32_t farthest = faces.front();
    for (const std::int32_t f : faces) {
      if (distance_[f] > distance_[farthest]) farthest = f;
    }
    for (const std::int32_t f : faces) distance_[f] = kFar;
    return farthest;
  }

  std::int32_t source(std::int32_t f) const { return source_[f]; }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  const Gluing& gluing_;
  std::vector<double> distance_;
  std::vector<std::int32_t> source_;
};

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
  for (const auto& [chart, face, other_face] : cuts) {
    if (faces_[chart].size() < 2 || execution.IsStopped()) continue;
    const std::vector<std::int32_t> faces = faces_[chart];
    // Each face goes with the nearer one of two.
    std::int32_t first = face, second = other_face;
    if (face < 0) {
      // About as far from each other as faces of this chart can be.
      distances.From({faces.front()});
      first = distances.TakeFarthest(faces);
      distances.From({first});
      second = distances.TakeFarthest(faces);
    }
    distances.From({first, second});
    const auto added = static_cast<std::int32_t>(faces_.size());
    faces_.emplace_back();
    faces_[chart].clear();
    for (const std::int32_t f : faces) {
      chart_[f] = distances.source(f) == first ? chart : added;
      faces_[chart_[f]].push_back(f);
    }
    for (const std::int32_t f : faces) {
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        if (!gluing_.IsOutline(c) && chart_[gluing_.opposite()[c] / 3] != chart_[f]) gluing_.Unglue(c);
      }
    }
    for (const std::int32_t half : {chart, added}) {
      changed.push_back(half);
      if (IsDisc(faces_[half])) continue;
      // It runs round the other half.
      for (const std::int32_t f : faces_[half]) {
        for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
          if (!gluing_.IsOutline(c)) gluing_.Unglue(c);
        }
      }
      std::vector<std::int32_t> piece(chart_.size(), -1);
      for (const std::int32_t f : faces_[half]) piece[f] = 0;
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
