#include "core/unwrap/chart_estimate.h"

#include <algorithm>
#include <cmath>

#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"
#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/pack/outline.h"

namespace planish {
namespace {

AtlasTuning ForMaps(AtlasTuning tuning) {
  tuning.estimate_tolerance = tuning.map_tolerance;
  return tuning;
}

// Finds the two segments of a closed curve that cross and are farthest apart along it; -1 if none cross. The sides of a
// slit may lie on each other, so segments count only if the ends of each are on both sides of the other, farther than
// `least` from its line. The search ends after a number of tests that curves of ordinary shapes do not need. What it
// misses is found once the chart is solved.
std::pair<std::int32_t, std::int32_t> FarthestCrossing(const std::vector<Vec2>& curve, double least) {
  const auto n = static_cast<std::int32_t>(curve.size());
  const auto end = [&](std::int32_t i) -> const Vec2& { return curve[i + 1 == n ? 0 : i + 1]; };
  std::vector<Box> boxes;
  std::vector<double> along = {0};
  for (std::int32_t i = 0; i < n; ++i) {
    boxes.push_back(Box::Around(curve[i], end(i)));
    along.push_back(along.back() + (end(i) - curve[i]).norm());
  }
  const BoxTree tree(std::move(boxes));
  const auto parts = [&](std::int32_t i, std::int32_t j) {
    const double length = (end(i) - curve[i]).norm();
    const double from = DoubleArea(curve[i], end(i), curve[j]), to = DoubleArea(curve[i], end(i), end(j));
    return std::min(from, to) < -least * length && std::max(from, to) > least * length;
  };
  std::pair<std::int32_t, std::int32_t> crossing(-1, -1);
  double farthest = 0;
  constexpr std::int64_t kTestsPerSegment = 32;
  std::int64_t tests_left = kTestsPerSegment * n;
  for (std::int32_t i = 0; i < n && tests_left > 0; ++i) {
    tree.ForEachMeeting(tree.boxes()[i], [&](std::int32_t j) {
      if (--tests_left < 0) return false;
      if (j <= i) return true;
      const double between = std::min(along[j] - along[i], along[n] - along[j] + along[i]);
      if (between > farthest && parts(i, j) && parts(j, i)) {
        farthest = between;
        crossing = {i, j};
      }
      return true;
    });
  }
  return crossing;
}

// The third corner of a counter-clockwise triangle with edges of these lengths, whose first corner is `from` and whose
// second one lies in the direction of `to`. `from` if the result is not finite, as where the first two corners
// coincide.
Vec2 ThirdCorner(const Vec2& from, const Vec2& to, double base, double from_third, double to_third) {
  const Vec2 along = (to - from).normalized();
  const double foot = (base * base + from_third * from_third - to_third * to_third) / (2 * base);
  const double height = std::sqrt(std::max(0.0, from_third * from_third - foot * foot));
  const Vec2 third = from + foot * along + height * Vec2(-along.y(), along.x());
  return third.allFinite() ? third : from;
}

}  // namespace

ChartEstimates::ChartEstimates(const Segmentation& segmentation, const AtlasTuning& tuning, const Execution& execution)
    : segmentation_(segmentation),
      tuning_(ForMaps(tuning)),
      estimate_(segmentation.gluing(), tuning_, segmentation.kept(), execution) {}

// The memory that stays idle is at most that of one estimate of the whole surface.
template <class Use>
void ChartEstimates::WithWork(const Use& use) {
  std::unique_ptr<StretchEstimate::Work> work;
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      work = std::move(idle_.back());
      idle_.pop_back();
    }
  }
  if (work == nullptr) work = std::make_unique<StretchEstimate::Work>();
  use(work.get());
  const std::lock_guard lock(mutex_);
  std::int64_t capacity = work->capacity();
  for (const auto& idle : idle_) capacity += idle->capacity();
  if (capacity <= static_cast<std::int64_t>(segmentation_.gluing().mesh().n_vertices())) {
    idle_.push_back(std::move(work));
  }
}

void ChartEstimates::Update(std::int32_t chart) {
  Reserve();
  charts_[chart] = {};
  WithWork([&](StretchEstimate::Work* work) {
    Solve(chart, work);
    estimate_.Keep(*work);
  });
  Trace(chart);
}

// The largest first, so that no thread begins with one when the others have ended.
void ChartEstimates::Update(std::span<const std::int32_t> charts, const Execution& execution) {
  Reserve();
  const auto size = [&](std::int32_t i) { return segmentation_.charts()[charts[i]].size(); };
  const std::vector<std::int32_t> order =
      SortedIndices(charts.size(), [&](std::int32_t i, std::int32_t j) { return size(i) > size(j); });
  execution.For(
      std::ssize(order),
      [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) Update(charts[order[i]]);
      },
      1);
}

ChartEstimates::Other ChartEstimates::Replace(std::int32_t chart) {
  Reserve();
  Other before = {std::exchange(charts_[chart], {}), {}};
  WithWork([&](StretchEstimate::Work* work) {
    Solve(chart, work);
    before.kept = estimate_.Replace(*work);
  });
  return before;
}

void ChartEstimates::Swap(std::int32_t chart, Other* other) {
  std::swap(charts_[chart], other->estimate);
  estimate_.Swap(&other->kept);
}

void ChartEstimates::DropEmpty() {
  std::size_t end = 0;
  for (std::size_t i = 0; i < charts_.size(); ++i) {
    if (segmentation_.charts()[i].empty()) continue;
    if (i != end) charts_[end] = std::move(charts_[i]);
    ++end;
  }
  charts_.resize(end);
}

void ChartEstimates::Solve(std::int32_t chart, StretchEstimate::Work* work) {
  const std::vector<std::int32_t>& faces = segmentation_.charts()[chart];
  double area = 0;
  for (const std::int32_t f : faces) area += segmentation_.gluing().surface().area[f];
  charts_[chart].stretch = estimate_.Whole({estimate_.InteriorOf(faces)}, area, work).Stretch();
}

void ChartEstimates::Trace(std::int32_t chart) {
  constexpr double kCoincide = 1e-6;  // of the outline
  const Gluing& gluing = segmentation_.gluing();
  ChartEstimate& found = charts_[chart];
  if (!found.outline.empty()) return;
  found.outline = OutlineFrom(gluing, FirstOnOutline(gluing, segmentation_.charts()[chart]));
  found.points = estimate_.Outline(found.outline);
  found.waste = std::max(0.0, AreaWithin(ConvexHull(found.points)) - std::abs(AreaWithin(found.points)));
  double length = 0;
  for (const HalfedgeHandle h : found.outline) length += gluing.surface().length(h);
  const auto [i, j] = FarthestCrossing(found.points, kCoincide * length);
  if (i < 0) return;
  found.face = gluing.mesh().face_handle(found.outline[i]).idx();
  found.other_face = gluing.mesh().face_handle(found.outline[j]).idx();
}

std::vector<Vec2> ChartEstimates::Positions(std::int32_t chart, const FlatMesh& disc) const {
  const TriMesh& mesh = segmentation_.gluing().mesh();
  const std::vector<std::int32_t>& faces = segmentation_.charts()[chart];
  const FlatLinks links = {disc.opposite};
  std::vector<Vec2> positions(disc.positions.size());
  enum class State : char { kFar, kQueued, kPlaced };
  std::vector<State> state(disc.positions.size(), State::kFar);
  std::vector<double> root(disc.positions.size(), 1.0);  // the square root of e^u
  const auto vertex_at = [&](std::int32_t c) { return disc.faces[c / 3][c % 3]; };
  const auto is_placed = [&](std::int32_t c) { return state[vertex_at(c)] == State::kPlaced; };
  for (std::size_t i = 0; i < charts_[chart].outline.size(); ++i) {
    const std::int32_t faced = CornerOf(mesh, charts_[chart].outline[i]);
    const auto f = std::lower_bound(faces.begin(), faces.end(), faced / 3) - faces.begin();
    const std::int32_t v = disc.faces[f][Next(faced % 3)];
    positions[v] = charts_[chart].points[i];
    state[v] = State::kPlaced;
  }
  std::vector<std::int32_t> queue;  // corners
  const auto reach = [&](std::int32_t c) {
    if (state[vertex_at(c)] != State::kFar || !is_placed(links.Next(c)) || !is_placed(links.Prev(c))) return;
    state[vertex_at(c)] = State::kQueued;
    queue.push_back(c);
  };
  for (std::int32_t c = 0; c < std::ssize(disc.opposite); ++c) reach(c);
  const auto length = [&](std::int32_t v, std::int32_t w) {
    return (disc.positions[v] - disc.positions[w]).norm() * root[v] * root[w];
  };
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const std::int32_t v = vertex_at(queue[head]);
    const VertexHandle on_surface = VerticesOf(mesh, FaceHandle(faces[queue[head] / 3]))[queue[head] % 3];
    root[v] = portable::Exp(estimate_.KeptAt(on_surface.idx()) / 2);
    Vec2 sum = Vec2::Zero();
    double count = 0;
    ForEachInFan(links, queue[head], [&](std::int32_t c) {
      if (!is_placed(links.Next(c)) || !is_placed(links.Prev(c))) return;
      const std::int32_t from = Origin(disc.faces, c), to = Target(disc.faces, c);
      sum += ThirdCorner(positions[from], positions[to], length(from, to), length(from, v), length(to, v));
      ++count;
    });
    positions[v] = sum / count;
    state[v] = State::kPlaced;
    ForEachInFan(links, queue[head], [&](std::int32_t c) {
      reach(links.Next(c));
      reach(links.Prev(c));
    });
  }
  return positions;
}

}  // namespace planish
