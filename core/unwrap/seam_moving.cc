// Moving seams to cheaper paths.
#include <algorithm>
#include <utility>

#include "core/base/radix_sort.h"
#include "core/mesh/symmetry.h"
#include "core/unwrap/seam_search.h"

namespace planish {
namespace {

constexpr std::size_t kArc = 48;  // half-edges of a path that are moved at once

}  // namespace

std::optional<SeamSearch::Moved> SeamSearch::Reroute(std::span<const HalfedgeHandle> path, bool slides, int band) {
  if (!IsPath(segmentation_.gluing(), path)) return std::nullopt;
  const std::vector<HalfedgeHandle> image = ImageOf(path);
  if (Meet(path, image)) return std::nullopt;  // the seam lies on the mirror plane, or crosses it
  const std::int32_t i = ChartOf(path.front()), j = ChartAcross(path.front());
  Moved moved;
  moved.chart = i;
  moved.other = j;
  moved.key = {path.front().idx(), path.size()};
  const std::optional<std::vector<HalfedgeHandle>> way = router_.Reroute(path, slides, band);
  if (!way || !MoveTo(path, *way, &moved) || (!image.empty() && !MoveTo(image, ImageOf(*way), &moved))) {
    UndoMove(&moved);
    moved.parts.clear();
    moved.charts.clear();
  }
  return moved;
}

void SeamSearch::EstimateMoved(std::size_t at, Moved* moved) {
  const std::int32_t chart = moved->charts[at];
  moved->costs[at] = CostOf(chart);
  moved->before[at] = estimates_.Replace(chart);
  Measure(chart);
}

bool SeamSearch::IsNoWorse(const ChartEstimate& before, const ChartEstimate& after, std::int32_t i) const {
  return IsToSplit(job_, charts_, i, before) && after.stretch <= std::max(before.stretch, job_.options.MaxStretch());
}

double SeamSearch::Keep(Moved* moved) {
  if (moved->parts.empty()) {
    Fail(moved->key, moved->chart, moved->other);
    return 0;
  }
  double of_paths = 0;
  for (const typename Moved::Part& part : moved->parts) of_paths += cost_.OfPath(part.from) - cost_.OfPath(part.to);
  double gain = of_paths;
  bool is_sound = true;
  for (std::size_t k = 0; k < moved->charts.size() && is_sound; ++k) {
    // Looks at the image charts only if twice the gain is enough, since they gain about as much.
    is_sound = k != 2 || moved->charts.size() < 4 || 2 * gain - of_paths > kWorthIt;
    if (!is_sound) break;
    const std::int32_t chart = moved->charts[k];
    if (k == moved->before.size()) {
      MakeRoom(k + 1, moved);
      EstimateMoved(k, moved);
    }
    gain += moved->costs[k];
    move_left_ -= static_cast<double>(segmentation_.charts()[chart].size());
    gain -= CostOf(chart);
    const bool is_mended = charts_.are_mended && IsNoWorse(moved->before[k].estimate, estimates_.of(chart), chart);
    is_sound = is_mended || MayBeSound(chart);
    const bool is_last = k + 1 == moved->charts.size();
    if (!is_sound || (is_last && !(gain > kWorthIt))) break;
    gain += CostOf(chart);
    estimates_.Trace(chart);
    gain -= CostOf(chart);
    is_sound = is_mended || IsSound(chart);
  }
  if (is_sound && gain > kWorthIt) {
    for (const std::int32_t k : moved->charts) ++version_[k];
    return gain;
  }
  UndoMove(moved);
  Fail(moved->key, moved->chart, moved->other);
  return 0;
}

bool SeamSearch::CanLeadTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way) const {
  const Gluing& gluing = segmentation_.gluing();
  const TriMesh& mesh = gluing.mesh();
  const auto is_on_path = [&](VertexHandle v) {
    return std::any_of(path.begin() + 1, path.end(), [&](HalfedgeHandle h) { return mesh.from_vertex_handle(h) == v; });
  };
  const std::int32_t i = ChartOf(path.front()), j = ChartAcross(path.front());
  for (const HalfedgeHandle h : way) {
    if (surface_.face_across(h) < 0 || surface_.is_uncut(h)) return false;
    if (gluing.IsOutline(h) && !Meet({&h, 1}, path)) return false;
    if ((ChartOf(h) != i && ChartOf(h) != j) || (ChartAcross(h) != i && ChartAcross(h) != j)) return false;
    const VertexHandle v = mesh.to_vertex_handle(h);
    const bool is_free = gluing.IsInside(v) || is_on_path(v);
    if (is_free == (h == way.back())) return false;
  }
  const VertexHandle start = mesh.from_vertex_handle(way.front());
  return !gluing.IsInside(start) && !is_on_path(start);
}

bool SeamSearch::MoveTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way, Moved* moved) {
  if (way.empty() || !IsPath(segmentation_.gluing(), path)) return false;
  const std::int32_t i = ChartOf(path.front()), j = ChartAcross(path.front());
  if (!CanLeadTo(path, way)) return false;
  if (!segmentation_.MoveSeam(i, j, path, way)) return false;
  moved->parts.push_back({i, j, {path.begin(), path.end()}, way});
  for (const std::int32_t k : {i, j}) {
    if (std::find(moved->charts.begin(), moved->charts.end(), k) == moved->charts.end()) moved->charts.push_back(k);
  }
  return true;
}

void SeamSearch::UndoMove(Moved* moved) {
  for (std::size_t k = moved->parts.size(); k-- > 0;) {
    const typename Moved::Part& part = moved->parts[k];
    segmentation_.UndoMoveSeam(part.chart, part.other, part.from, part.to);
  }
  for (std::size_t k = moved->before.size(); k-- > 0;) estimates_.Swap(moved->charts[k], &moved->before[k]);
  for (std::size_t k = 0; k < moved->before.size(); ++k) Measure(moved->charts[k]);
}

bool SeamSearch::EndsOnPlane(HalfedgeHandle h) const {
  const TriMesh& mesh = *surface_.mesh;
  const HalfedgeHandle image = ImageOf(h);
  return image.is_valid() && mesh.from_vertex_handle(image) == mesh.to_vertex_handle(h);
}

std::vector<SeamSearch::Step> SeamSearch::StepsOf(const std::vector<SeamPath>& paths) const {
  std::vector<double> cost;
  for (const SeamPath& path : paths) cost.push_back(cost_.OfPath(path.half_edges));
  std::vector<Step> steps;
  for (const std::int32_t p :
       SortedIndices(paths.size(), [&](std::int32_t a, std::int32_t b) { return cost[a] > cost[b]; })) {
    const std::span<const HalfedgeHandle> path = paths[p].half_edges;
    if (!paths[p].is_loop && path.size() <= kArc) {
      steps.push_back({path, paths[p].slides, /*is_first=*/true});
      continue;
    }
    const std::size_t arcs = std::max<std::size_t>(2, (path.size() + kArc - 1) / kArc);
    if (path.size() < 2 * arcs) continue;
    for (std::size_t k = 0; k < arcs; ++k) {
      const std::size_t begin = k * path.size() / arcs, end = (k + 1) * path.size() / arcs;
      steps.push_back({path.subspan(begin, end - begin), /*slides=*/false, /*is_first=*/k == 0});
    }
  }
  return steps;
}

std::vector<std::int32_t> SeamSearch::ChartsOf(std::span<const HalfedgeHandle> path) const {
  std::vector<std::int32_t> charts;
  const auto add = [&](HalfedgeHandle h) {
    for (const std::int32_t i : {ChartOf(h), ChartAcross(h)}) {
      charts.push_back(i);
      if (ImageOf(i) >= 0) charts.push_back(ImageOf(i));
    }
  };
  add(path.front());
  const std::vector<HalfedgeHandle> image = ImageOf(path);
  if (!image.empty() && surface_.face_across(image.front()) >= 0) add(image.front());
  return charts;
}

void SeamSearch::MoveAhead(std::span<Step> steps) {
  const int threads = job_.execution.Team().size();
  const auto most = static_cast<std::size_t>(threads == 1 ? 1 : kAheadPerThread * threads);
  ++stamp_;
  stamps_.resize(count(), 0);
  std::vector<std::pair<Moved*, std::size_t>> todo;
  for (Step& step : steps.first(std::min(steps.size(), most))) {
    // Once it has been moved, its path lies inside of a chart.
    if (!step.is_ahead) step.charts = ChartsOf(step.path);
    const bool is_free =
        std::none_of(step.charts.begin(), step.charts.end(), [&](std::int32_t i) { return stamps_[i] == stamp_; });
    for (const std::int32_t i : step.charts) stamps_[i] = stamp_;
    if (!is_free || std::exchange(step.is_ahead, true)) continue;
    const BorderKey key = {step.path.front().idx(), step.path.size()};
    if (HasFailed(key, ChartOf(step.path.front()), ChartAcross(step.path.front()))) continue;
    step.moved = Reroute(step.path, step.slides, tuning_.seam_band);
    if (!step.moved || threads == 1) continue;
    MakeRoom(std::min<std::size_t>(2, step.moved->charts.size()), &*step.moved);
    for (std::size_t k = 0; k < step.moved->before.size(); ++k) todo.emplace_back(&*step.moved, k);
  }
  estimates_.Reserve();
  job_.execution.Team().ForEach(
      std::ssize(todo),
      [&](std::int64_t i) {
        const auto& [moved, k] = todo[i];
        EstimateMoved(k, moved);
        if (MayBeSound(moved->charts[k])) estimates_.Trace(moved->charts[k]);
      },
      /*chunk_size=*/1);
}

double SeamSearch::Move() {
  double gained = 0;
  std::vector<SeamPath> paths = SeamPaths(segmentation_);
  if (charts_.mirror) paths = OfOneSide(paths);
  std::vector<Step> steps = StepsOf(paths);
  std::size_t at = 0;
  for (; at < steps.size() && GoesOn() && (move_left_ > 0 || !steps[at].is_first); ++at) {
    if (steps[at].is_first) Tell();
    if (!steps[at].is_ahead) MoveAhead(std::span(steps).subspan(at));
    if (!steps[at].moved) continue;
    const bool has_way = !steps[at].moved->parts.empty();
    double gain = Keep(&*steps[at].moved);
    steps[at].moved.reset();
    if (has_way && gain == 0 && move_left_ > 0 && GoesOn()) {  // a way nearer to the seam may do
      std::optional<Moved> nearer = Reroute(steps[at].path, /*slides=*/false, tuning_.narrow_seam_band);
      if (nearer) gain = Keep(&*nearer);
    }
    gained += gain;
  }
  for (; at < steps.size(); ++at) {
    if (steps[at].moved) UndoMove(&*steps[at].moved);
  }
  return gained;
}

std::vector<SeamPath> SeamSearch::OfOneSide(const std::vector<SeamPath>& paths) const {
  const TriMesh& mesh = *surface_.mesh;
  const auto is_second = [&](std::int32_t f) { return charts_.mirror->side[f] == Mirror::Side::kSecond; };
  std::vector<SeamPath> parts;
  for (const SeamPath& path : paths) {
    std::vector<HalfedgeHandle> all = path.half_edges;
    bool is_whole = true;
    if (path.is_loop) {
      const auto crossing = std::find_if(all.begin(), all.end(), [&](HalfedgeHandle h) { return EndsOnPlane(h); });
      if (crossing != all.end()) {
        is_whole = false;
        std::rotate(all.begin(), crossing + 1, all.end());
      }
    }
    SeamPath part;
    for (std::size_t i = 0; i < all.size(); ++i) {
      part.half_edges.push_back(all[i]);
      const bool is_last = i + 1 == all.size();
      if (!is_last && !EndsOnPlane(all[i])) continue;
      is_whole = is_whole && is_last;
      const HalfedgeHandle h = part.half_edges.front();
      part.slides = is_whole;
      part.is_loop = path.is_loop && is_whole;
      const bool is_image = is_second(mesh.face_handle(h).idx()) && is_second(surface_.face_across(h)) &&
                            !ImageOf(part.half_edges).empty();
      if (!is_image) parts.push_back(part);
      part = {};
    }
  }
  return parts;
}

}  // namespace planish
