#include "core/charts/segmentation.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "core/charts/merging.h"
#include "core/charts/patches.h"

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
    patch_ = chart_;
    GluePieces(chart_, &gluing_);
  } else {
    patch_ = MakePatches(surface, execution);
    if (execution.IsStopped()) return;
    chart_ = patch_;
    const std::int32_t count = chart_.empty() ? 0 : *std::max_element(chart_.begin(), chart_.end()) + 1;
    MergePieces(std::vector<std::int32_t>(count, 0), max_stretch, execution, &gluing_, &chart_);
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

std::vector<std::int32_t> Segmentation::Split(const std::vector<Cut>& cuts, double max_stretch,
                                              const Execution& execution) {
  Distances distances(gluing_);
  std::vector<std::int32_t> half(surface_.num_faces(), -1);  // 2 charts' number + 0 or 1
  std::vector<std::int32_t> all_faces;
  for (const auto& [chart, face, other_face] : cuts) {
    const std::vector<std::int32_t>& faces = faces_[chart];
    if (faces.size() < 2 || execution.IsStopped()) continue;
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
    for (const std::int32_t f : faces) half[f] = 2 * chart + (distances.source(f) == first ? 0 : 1);
    all_faces.insert(all_faces.end(), faces.begin(), faces.end());
  }
  std::sort(all_faces.begin(), all_faces.end());
  for (const std::int32_t f : all_faces) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      if (!gluing_.IsOutline(c)) gluing_.Unglue(c);
    }
  }
  // Halves of patches may fall apart.
  std::vector<std::int32_t> label(half.size(), -1);
  std::int32_t patches = 0;
  for (const std::int32_t p : patch_) patches = std::max(patches, p + 1);
  {
    std::vector<std::pair<std::int32_t, std::int32_t>> keys;
    for (const std::int32_t f : all_faces) keys.emplace_back(half[f], patch_[f]);
    std::vector<std::pair<std::int32_t, std::int32_t>> distinct = keys;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    for (std::size_t i = 0; i < all_faces.size(); ++i) {
      label[all_faces[i]] = static_cast<std::int32_t>(
          std::lower_bound(distinct.begin(), distinct.end(), keys[i]) - distinct.begin());
    }
  }
  std::int32_t count = 0;
  std::vector<std::int32_t> piece = ConnectedPieces(surface_, all_faces, label, &count);
  std::vector<std::int32_t> family(count, -1);
  for (const std::int32_t f : all_faces) family[piece[f]] = half[f];
  for (const std::int32_t f : all_faces) patch_[f] = patches + piece[f];
  MergePieces(family, max_stretch, execution, &gluing_, &piece);

  // The disc with a chart's lowest face keeps its number.
  std::vector<std::int32_t> number(count, -1), changed;
  auto next = static_cast<std::int32_t>(faces_.size());
  std::vector<char> is_kept(faces_.size(), 0);
  for (const std::int32_t f : all_faces) {
    std::int32_t& n = number[piece[f]];
    if (n < 0) {
      const std::int32_t old = half[f] / 2;
      n = is_kept[old] ? next++ : old;
      is_kept[old] = 1;
      changed.push_back(n);
    }
    chart_[f] = n;
  }
  CollectFaces();
  std::sort(changed.begin(), changed.end());
  return changed;
}

}  // namespace planish
