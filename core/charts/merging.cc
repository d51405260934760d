#include "core/charts/merging.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <queue>
#include <utility>

#include "core/charts/stretch_estimate.h"

namespace planish {
namespace {

constexpr double kScoreUnit = 1e-6;
constexpr double kSharpest = 0.02;  // weight of an edge that bends by a right angle or more
constexpr double kMinCompactness =
    0.12;  // 4 pi area / perimeter^2 of a chart; 1 for a disc, 0.12 for a strip of 1 to 24

struct Disc {
  std::vector<std::int32_t> faces;  // none: glued to another one
  double area = 0;
  double perimeter = 0;
  double stretch = 1;
  std::int32_t outline = -1;  // one of its half-edges
  std::int32_t outline_edges = 0;
  std::int32_t version = 0;
};

// A stretch of the common outline of two discs.
struct Joint {
  std::int64_t score;
  std::int32_t first;  // half-edge of `disc`, followed by `edges` - 1 more
  std::int32_t edges;
  std::int32_t disc, other;
  std::int32_t version, other_version;

  bool operator<(const Joint& o) const {
    return score != o.score ? score < o.score : first != o.first ? first > o.first : disc > o.disc;
  }
};

class Merging {
 public:
  Merging(std::int32_t count, double max_stretch, Gluing* gluing, std::vector<std::int32_t>* disc_of)
      : max_stretch_(max_stretch),
        surface_(gluing->surface()),
        gluing_(*gluing),
        disc_of_(*disc_of),
        estimate_(*gluing),
        discs_(count) {}

  void Run(const Execution& execution);

 private:
  double EdgeWeight(std::int32_t c) const;
  void WalkOutline(std::int32_t d);
  void PushJoints(std::int32_t d, bool all);
  void TryJoint(const Joint& joint);
  std::int32_t Neighbour(std::int32_t c) const {
    const std::int32_t o = surface_.across[c];
    return o < 0 ? -1 : disc_of_[o / 3];
  }

  const double max_stretch_;
  const Surface& surface_;
  Gluing& gluing_;
  std::vector<std::int32_t>& disc_of_;
  StretchEstimate estimate_;
  std::vector<Disc> discs_;
  std::priority_queue<Joint> queue_;
  std::vector<std::int32_t> walk_;  // an outline
};

// Length, less where the surface bends.
double Merging::EdgeWeight(std::int32_t c) const {
  return surface_.length(c) * std::max(kSharpest, surface_.bend_cosine(c));
}

// Outline of disc d to walk_; its numbers.
void Merging::WalkOutline(std::int32_t d) {
  Disc& disc = discs_[d];
  if (disc.outline < 0 || !gluing_.IsOutline(disc.outline)) {
    disc.outline = -1;
    for (const std::int32_t f : disc.faces) {
      for (std::int32_t c = 3 * f; c < 3 * f + 3 && disc.outline < 0; ++c) {
        if (gluing_.IsOutline(c)) disc.outline = c;
      }
      if (disc.outline >= 0) break;
    }
  }
  walk_.clear();
  disc.perimeter = 0;
  std::int32_t c = disc.outline;
  do {
    walk_.push_back(c);
    disc.perimeter += surface_.length(c);
    c = gluing_.After(c);
  } while (c != disc.outline);
  disc.outline_edges = static_cast<std::int32_t>(walk_.size());
}

void Merging::PushJoints(std::int32_t d, bool all) {
  WalkOutline(d);
  const auto n = static_cast<std::int32_t>(walk_.size());
  const auto joins = [&](std::int32_t i) {
    const std::int32_t other = Neighbour(walk_[i]);
    return other >= 0 && other != d;
  };
  // Whether half-edge i + 1 of the walk goes on with the same joint as half-edge i.
  const auto goes_on = [&](std::int32_t i) {
    const std::int32_t c = walk_[i], next = walk_[i + 1 == n ? 0 : i + 1];
    return joins(i) && Neighbour(next) == Neighbour(c) && gluing_.After(surface_.across[next]) == surface_.across[c];
  };
  std::int32_t begin = 0;
  while (begin < n && goes_on(begin == 0 ? n - 1 : begin - 1)) ++begin;
  if (begin == n) return;  // two discs that make a sphere
  for (std::int32_t done = 0; done < n;) {
    const std::int32_t start = (begin + done) % n;
    std::int32_t edges = 1;
    while (edges < n && goes_on((start + edges - 1) % n)) ++edges;
    done += edges;
    if (!joins(start)) continue;
    const std::int32_t other = Neighbour(walk_[start]);
    if (!all && other < d) continue;
    if (discs_[d].outline_edges + discs_[other].outline_edges - 2 * edges < 3) continue;
    double weight = 0, length = 0;
    for (std::int32_t i = 0; i < edges; ++i) {
      weight += EdgeWeight(walk_[(start + i) % n]);
      length += surface_.length(walk_[(start + i) % n]);
    }
    const double shorter = std::min(discs_[d].perimeter, discs_[other].perimeter);
    const double area = discs_[d].area + discs_[other].area;
    const double perimeter = discs_[d].perimeter + discs_[other].perimeter - 2 * length;
    const double compactness = perimeter > 0 ? 4 * std::numbers::pi * area / (perimeter * perimeter) : 0;
    const double best =
        std::max(4 * std::numbers::pi * discs_[d].area / (discs_[d].perimeter * discs_[d].perimeter),
                 4 * std::numbers::pi * discs_[other].area / (discs_[other].perimeter * discs_[other].perimeter));
    if (compactness < kMinCompactness && compactness < best) continue;
    const double score = shorter > 0 ? weight / shorter * std::sqrt(std::min(1.0, compactness)) : 1;
    queue_.push(
        {std::llround(score / kScoreUnit), walk_[start], edges, d, other, discs_[d].version, discs_[other].version});
  }
}

void Merging::TryJoint(const Joint& joint) {
  Disc &disc = discs_[joint.disc], &other = discs_[joint.other];
  // What is next to the joint on the outlines, before it is glued.
  std::vector<std::int32_t> glued;
  std::int32_t c = joint.first;
  const std::int32_t before = gluing_.Before(c);
  for (std::int32_t i = 0; i < joint.edges; ++i, c = gluing_.After(c)) glued.push_back(c);
  const std::int32_t before_across = gluing_.Before(surface_.across[glued.back()]);
  for (const std::int32_t g : glued) gluing_.Glue(g);
  for (const std::int32_t e : {before, before_across}) {
    if (gluing_.IsOutline(e)) gluing_.Zip(e, &glued);
  }
  const auto undo = [&] {
    for (const std::int32_t g : glued) gluing_.Unglue(g);
  };
  for (const std::int32_t e : {before, before_across}) {
    if (gluing_.IsOutline(e) && gluing_.OutlineAngle(e) > kWidest) return undo();
  }
  const double stretch = estimate_(disc.faces, other.faces);
  const double parts =
      std::sqrt((disc.stretch * disc.stretch * disc.area + other.stretch * other.stretch * other.area) /
                (disc.area + other.area));
  if (!(stretch <= std::max(max_stretch_, parts))) return undo();
  estimate_.Keep();
  std::int32_t to = joint.disc, from = joint.other;
  if (discs_[to].faces.size() < discs_[from].faces.size()) std::swap(to, from);
  for (const std::int32_t f : discs_[from].faces) disc_of_[f] = to;
  discs_[to].faces.insert(discs_[to].faces.end(), discs_[from].faces.begin(), discs_[from].faces.end());
  discs_[to].area += discs_[from].area;
  discs_[to].stretch = stretch;
  ++discs_[to].version;
  ++discs_[from].version;
  discs_[from].faces = {};
  PushJoints(to, true);
}

void Merging::Run(const Execution& execution) {
  GluePieces(disc_of_, &gluing_);
  const auto count = static_cast<std::int32_t>(discs_.size());
  for (std::int32_t f = 0; f < surface_.num_faces(); ++f) {
    if (disc_of_[f] < 0) continue;
    discs_[disc_of_[f]].faces.push_back(f);
    discs_[disc_of_[f]].area += surface_.area[f];
  }
  for (std::int32_t d = 0; d < count; ++d) {
    discs_[d].stretch = estimate_(discs_[d].faces, {});
    estimate_.Keep();
    WalkOutline(d);
  }
  for (std::int32_t d = 0; d < count && !execution.IsStoppedAt(d); ++d) PushJoints(d, false);
  while (!queue_.empty() && !execution.IsStopped() && !execution.IsHurried()) {
    const Joint joint = queue_.top();
    queue_.pop();
    if (discs_[joint.disc].version != joint.version || discs_[joint.other].version != joint.other_version) continue;
    TryJoint(joint);
  }
  std::vector<std::int32_t> number(count, -1);
  std::int32_t charts = 0;
  for (std::int32_t& d : disc_of_) {
    if (d < 0) continue;
    if (number[d] < 0) number[d] = charts++;
    d = number[d];
  }
}

}  // namespace

void GluePieces(const std::vector<std::int32_t>& piece, Gluing* gluing) {
  const Surface& surface = gluing->surface();
  std::vector<char> seen(piece.size(), 0);
  std::vector<std::int32_t> order, zipped;
  // A face and those it must not be parted from.
  const auto reach = [&](std::int32_t first) {
    seen[first] = 1;
    order.push_back(first);
    for (std::size_t i = order.size() - 1; i < order.size(); ++i) {
      for (std::int32_t c = 3 * order[i]; c < 3 * order[i] + 3; ++c) {
        const std::int32_t o = surface.across[c];
        if (o < 0 || !surface.is_uncut(c) || seen[o / 3] || piece[o / 3] != piece[first]) continue;
        seen[o / 3] = 1;
        gluing->Glue(c);
        order.push_back(o / 3);
      }
    }
  };
  for (std::int32_t start = 0; start < surface.num_faces(); ++start) {
    if (seen[start] || piece[start] < 0) continue;
    // A spanning tree of its faces, nearest first, makes a disc of it; then its slits are zipped up.
    order.clear();
    reach(start);
    for (std::size_t i = 0; i < order.size(); ++i) {
      for (std::int32_t c = 3 * order[i]; c < 3 * order[i] + 3; ++c) {
        const std::int32_t o = surface.across[c];
        if (o < 0 || seen[o / 3] || piece[o / 3] != piece[start]) continue;
        gluing->Glue(c);
        reach(o / 3);
      }
    }
    for (const std::int32_t f : order) {
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        if (gluing->IsOutline(c)) gluing->Zip(c, &zipped);
      }
    }
  }
}

void MergePieces(std::int32_t count, double max_stretch, const Execution& execution, Gluing* gluing,
                 std::vector<std::int32_t>* piece) {
  Merging(count, max_stretch, gluing, piece).Run(execution);
}

}  // namespace planish
