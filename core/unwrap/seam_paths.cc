#include "core/unwrap/seam_paths.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace planish {
namespace {

constexpr double kUnreached = std::numeric_limits<double>::infinity();

// Whether an edge is a seam that may be moved.
bool IsSeam(const Gluing& gluing, HalfedgeHandle h) {
  return gluing.IsOutline(h) && !gluing.mesh().is_boundary(h) &&
         !gluing.mesh().is_boundary(gluing.mesh().opposite_halfedge_handle(h));
}

// The half-edge with which the seam goes on; invalid where it ends or meets others.
HalfedgeHandle Onwards(const Gluing& gluing, HalfedgeHandle h) {
  const TriMesh& mesh = gluing.mesh();
  HalfedgeHandle next;
  for (const HalfedgeHandle out : mesh.voh_range(mesh.to_vertex_handle(h))) {
    if (!gluing.IsOutline(out) || out == mesh.opposite_halfedge_handle(h)) continue;
    if (next.is_valid() || !IsSeam(gluing, out)) return HalfedgeHandle();
    next = out;
  }
  return next;
}

}  // namespace

std::vector<SeamPath> SeamPaths(const Segmentation& segmentation) {
  const Gluing& gluing = segmentation.gluing();
  const TriMesh& mesh = gluing.mesh();
  std::vector<char> seen(mesh.n_edges(), 0);
  std::vector<SeamPath> paths;
  for (const EdgeHandle e : mesh.edges()) {
    const HalfedgeHandle first = mesh.halfedge_handle(e, 0);
    if (seen[e.idx()] || !IsSeam(gluing, first)) continue;
    if (segmentation.chart()[mesh.face_handle(first).idx()] < 0) continue;
    if (segmentation.chart()[gluing.surface().face_across(first)] < 0) continue;
    SeamPath path;
    std::vector<HalfedgeHandle> back;
    seen[e.idx()] = 1;
    HalfedgeHandle h = mesh.opposite_halfedge_handle(first);
    while ((h = Onwards(gluing, h)).is_valid() && !std::exchange(seen[h.idx() / 2], 1)) back.push_back(h);
    path.is_loop = h.is_valid();
    for (std::size_t i = back.size(); i-- > 0;) path.half_edges.push_back(mesh.opposite_halfedge_handle(back[i]));
    path.half_edges.push_back(first);
    h = first;
    while (!path.is_loop && (h = Onwards(gluing, h)).is_valid()) {
      seen[h.idx() / 2] = 1;
      path.half_edges.push_back(h);
    }
    paths.push_back(std::move(path));
  }
  return paths;
}

bool IsPath(const Gluing& gluing, std::span<const HalfedgeHandle> path) {
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (!IsSeam(gluing, path[i])) return false;
    if (i + 1 < path.size() && Onwards(gluing, path[i]) != path[i + 1]) return false;
  }
  return true;
}

SeamRouter::SeamRouter(const Segmentation& segmentation, const SeamCost& cost, const AtlasTuning& tuning)
    : segmentation_(segmentation),
      cost_(cost),
      tuning_(tuning),
      role_(segmentation.gluing().mesh().n_vertices(), Role::kNone),
      ring_(role_.size(), -1),
      is_on_path_(segmentation.gluing().mesh().n_edges(), 0),
      so_far_(segmentation.gluing().mesh().n_halfedges(), kUnreached),
      before_(so_far_.size()) {}

void SeamRouter::Mark(VertexHandle v, Role role) {
  if (role_[v.idx()] == Role::kNone && ring_[v.idx()] < 0) touched_.push_back(v);
  role_[v.idx()] = role;
}

bool SeamRouter::IsOnPath(HalfedgeHandle h) const {
  return is_on_path_[h.idx() / 2] != 0;
}

// Marks the ends of the path, and the vertices that they may slide to.
void SeamRouter::MarkEnds(std::span<const HalfedgeHandle> path, double reach) {
  const Gluing& gluing = segmentation_.gluing();
  const TriMesh& mesh = gluing.mesh();
  const HalfedgeHandle first = path.front(), last = path.back();
  const HalfedgeHandle first_across = mesh.opposite_halfedge_handle(first);
  const HalfedgeHandle last_across = mesh.opposite_halfedge_handle(last);
  std::vector<VertexHandle> of_start = {mesh.from_vertex_handle(first)}, of_end = {mesh.to_vertex_handle(last)};
  // Adds the vertices within `reach` along the outline of one of the charts, away from the path.
  const auto walk = [&](HalfedgeHandle h, bool forwards, std::vector<VertexHandle>* found) {
    double left = reach;
    for (;;) {
      h = forwards ? gluing.After(h) : gluing.Before(h);
      left -= gluing.surface().length(h);
      if (left < 0 || IsOnPath(h)) return;
      found->push_back(forwards ? mesh.to_vertex_handle(h) : mesh.from_vertex_handle(h));
    }
  };
  if (reach > 0) {
    walk(first, false, &of_start);
    walk(first_across, true, &of_start);
    walk(last, true, &of_end);
    walk(last_across, false, &of_end);
  }
  // Vertices to which both ends could slide are left out.
  const std::vector<VertexHandle> own_start = {of_start[0]}, own_end = {of_end[0]};
  const auto has = [](const std::vector<VertexHandle>& in, VertexHandle v) {
    return std::find(in.begin(), in.end(), v) != in.end();
  };
  starts_.clear();
  for (const VertexHandle v : of_start) {
    if (v != of_start[0] && (has(of_end, v) || has(starts_, v))) continue;
    starts_.push_back(v);
    Mark(v, Role::kStart);
  }
  for (const VertexHandle v : of_end) {
    if (v != of_end[0] && (has(of_start, v) || role_[v.idx()] != Role::kNone)) continue;
    Mark(v, Role::kEnd);
  }
}

// Marks the vertices near the path that can be reached through the two charts.
void SeamRouter::MarkBand(std::span<const HalfedgeHandle> path, int band) {
  const Gluing& gluing = segmentation_.gluing();
  const TriMesh& mesh = gluing.mesh();
  std::vector<VertexHandle> queue;
  const auto reach = [&](VertexHandle v, std::int32_t ring) {
    if (ring_[v.idx()] >= 0) return;
    if (role_[v.idx()] == Role::kNone) touched_.push_back(v);
    ring_[v.idx()] = ring;
    queue.push_back(v);
  };
  for (const HalfedgeHandle h : path) {
    reach(mesh.from_vertex_handle(h), 0);
    reach(mesh.to_vertex_handle(h), 0);
  }
  for (const VertexHandle v : starts_) reach(v, 0);
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const std::int32_t ring = ring_[queue[i].idx()];
    if (ring >= band) break;
    if (!gluing.IsInside(queue[i]) && role_[queue[i].idx()] != Role::kPath) continue;
    for (const HalfedgeHandle out : mesh.voh_range(queue[i])) reach(mesh.to_vertex_handle(out), ring + 1);
  }
}

std::optional<std::vector<HalfedgeHandle>> SeamRouter::Reroute(std::span<const HalfedgeHandle> path, bool slides,
                                                               int band) {
  const Gluing& gluing = segmentation_.gluing();
  const TriMesh& mesh = gluing.mesh();
  const std::vector<std::int32_t>& chart = segmentation_.chart();
  const std::int32_t one = chart[mesh.face_handle(path.front()).idx()];
  const std::int32_t other = chart[gluing.surface().face_across(path.front())];
  double length = 0;
  for (const HalfedgeHandle h : path) {
    is_on_path_[h.idx() / 2] = 1;
    length += gluing.surface().length(h);
  }
  for (std::size_t i = 0; i + 1 < path.size(); ++i) Mark(mesh.to_vertex_handle(path[i]), Role::kPath);
  MarkEnds(path, slides ? tuning_.seam_slide * length : 0);
  MarkBand(path, band);
  constexpr double kGain = 5e-3;
  double least = cost_.OfPath(path) * (1 - kGain);
  HalfedgeHandle best;
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  const auto reach = [&](HalfedgeHandle h, double cost, HalfedgeHandle before) {
    if (!(cost < least) || !(cost < so_far_[h.idx()])) return;
    if (so_far_[h.idx()] == kUnreached) reached_.push_back(h);
    so_far_[h.idx()] = cost;
    before_[h.idx()] = before;
    queue.emplace(cost, h.idx());
  };
  const auto for_each_way = [&](VertexHandle v, const auto& visit) {
    for (const HalfedgeHandle h : mesh.voh_range(v)) {
      if (mesh.is_boundary(h) || mesh.is_boundary(mesh.opposite_halfedge_handle(h))) continue;
      if (gluing.surface().is_uncut(h)) continue;
      if (gluing.IsOutline(h) && !IsOnPath(h)) continue;
      const std::int32_t of = chart[mesh.face_handle(h).idx()];
      if (of != one && of != other) continue;
      const VertexHandle to = mesh.to_vertex_handle(h);
      const Role role = role_[to.idx()];
      if (role == Role::kEnd || role == Role::kPath ||
          (role == Role::kNone && gluing.IsInside(to) && ring_[to.idx()] >= 0)) {
        visit(h);
      }
    }
  };
  for (const VertexHandle v : starts_) {
    for_each_way(v, [&](HalfedgeHandle h) { reach(h, cost_.OfEdge(h), HalfedgeHandle()); });
  }
  while (!queue.empty()) {
    const double cost = queue.top().first;
    const int number = queue.top().second;
    queue.pop();
    const HalfedgeHandle h(number);
    if (cost > so_far_[number]) continue;
    if (cost >= least) break;
    const VertexHandle v = mesh.to_vertex_handle(h);
    if (role_[v.idx()] == Role::kEnd) {
      best = h;
      break;
    }
    for_each_way(v, [&](HalfedgeHandle next) {
      if (next == mesh.opposite_halfedge_handle(h)) return;
      reach(next, cost + cost_.OfTurn(h, next) + cost_.OfEdge(next), h);
    });
  }
  std::vector<HalfedgeHandle> way;
  for (HalfedgeHandle h = best; h.is_valid(); h = before_[h.idx()]) way.push_back(h);
  std::reverse(way.begin(), way.end());
  // Since turns have a cost, the cheapest way may visit a vertex twice. Such a way is not used.
  std::vector<int> vertices;
  for (const HalfedgeHandle h : way) vertices.push_back(mesh.to_vertex_handle(h).idx());
  if (!way.empty()) vertices.push_back(mesh.from_vertex_handle(way.front()).idx());
  std::sort(vertices.begin(), vertices.end());
  const bool is_simple = std::adjacent_find(vertices.begin(), vertices.end()) == vertices.end();
  for (const HalfedgeHandle h : path) is_on_path_[h.idx() / 2] = 0;
  for (const VertexHandle v : std::exchange(touched_, {})) {
    role_[v.idx()] = Role::kNone;
    ring_[v.idx()] = -1;
  }
  for (const HalfedgeHandle h : std::exchange(reached_, {})) so_far_[h.idx()] = kUnreached;
  if (way.empty() || !is_simple) return std::nullopt;
  return way;
}

}  // namespace planish
