// Copies charts to a surface of about the same shape: Segmentation::Like().
#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "core/charts/segmentation.h"
#include "core/charts/steps.h"

namespace planish {
namespace {

// Calls visit(half-edge, face across) for the edges of a face with another face.
template <class Visit>
void ForEachNeighbour(const Surface& surface, std::int32_t f, const Visit& visit) {
  for (const HalfedgeHandle h : HalfEdgesOf(*surface.mesh, FaceHandle(f))) {
    const std::int32_t g = surface.face_across(h);
    if (g >= 0 && surface.takes_part[g]) visit(h, g);
  }
}

// Faces without a value get the value of the nearest face, and all faces of a polygon the value of its first face.
void Fill(const Surface& surface, std::vector<std::int32_t>* like) {
  std::vector<std::int32_t> queue;
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (surface.takes_part[f] && (*like)[f] >= 0) queue.push_back(f);
  }
  for (std::size_t i = 0; i < queue.size(); ++i) {
    ForEachNeighbour(surface, queue[i], [&](HalfedgeHandle, std::int32_t g) {
      if ((*like)[g] >= 0) return;
      (*like)[g] = (*like)[queue[i]];
      queue.push_back(g);
    });
  }
  std::vector<char> is_seen(like->size(), 0);
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (!surface.takes_part[f] || std::exchange(is_seen[f], 1)) continue;
    queue = {f};
    for (std::size_t i = 0; i < queue.size(); ++i) {
      ForEachNeighbour(surface, queue[i], [&](HalfedgeHandle h, std::int32_t g) {
        if (!surface.is_uncut(h) || std::exchange(is_seen[g], 1)) return;
        (*like)[g] = (*like)[f];
        queue.push_back(g);
      });
    }
  }
}

// Gives each piece that is not the largest of its chart to the chart next to it with the longest common border.
// Returns whether there was such a piece.
bool MovePieces(const Surface& surface, std::int32_t count, std::vector<std::int32_t>* chart,
                std::vector<std::int32_t>* like) {
  std::int32_t pieces = 0;
  const std::vector<std::int32_t> piece = ConnectedPieces(
      surface.num_faces(), &pieces, [&](std::int32_t f) { return (*chart)[f] >= 0; },
      [&](std::int32_t f, int k) {
        const std::int32_t g = surface.face_across(HalfEdgesOf(*surface.mesh, FaceHandle(f))[k]);
        return g >= 0 && (*chart)[g] == (*chart)[f] ? g : -1;
      });
  std::vector<double> area(pieces, 0.0);
  std::vector<std::int32_t> of(pieces, -1), largest(count, -1);
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (piece[f] < 0) continue;
    area[piece[f]] += surface.area[f];
    of[piece[f]] = (*chart)[f];
  }
  for (std::int32_t p = 0; p < pieces; ++p) {
    std::int32_t& most = largest[of[p]];
    if (most < 0 || area[p] > area[most]) most = p;
  }
  struct Border {
    double length = 0;
    std::int32_t face = -1;  // across
  };
  std::vector<std::map<std::int32_t, Border>> borders(pieces);  // of small pieces, by chart
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (piece[f] < 0 || largest[of[piece[f]]] == piece[f]) continue;
    ForEachNeighbour(surface, f, [&](HalfedgeHandle h, std::int32_t g) {
      if (piece[g] < 0 || largest[of[piece[g]]] != piece[g]) return;
      Border& border = borders[piece[f]][(*chart)[g]];
      border.length += surface.length(h);
      if (border.face < 0) border.face = g;
    });
  }
  std::vector<std::int32_t> next(pieces, -1), face(pieces, -1);
  bool has_moved = false;
  for (std::int32_t p = 0; p < pieces; ++p) {
    double most = -1;
    for (const auto& [number, border] : borders[p]) {
      if (!(border.length > most)) continue;
      most = border.length;
      next[p] = number;
      face[p] = border.face;
    }
    has_moved = has_moved || next[p] >= 0;
  }
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (piece[f] < 0 || next[piece[f]] < 0) continue;
    (*chart)[f] = next[piece[f]];
    (*like)[f] = (*like)[face[piece[f]]];
  }
  return has_moved;
}

// Whether no slit lies between two faces that are near each other in one chart: they have a glued edge in common, or no
// edge and a few steps lead from one to the other.
bool AreTogether(const Gluing& gluing, std::int32_t from, std::int32_t to) {
  constexpr int kSteps = 3;
  bool are_neighbours = false, are_glued = false;
  ForEachNeighbour(gluing.surface(), from, [&](HalfedgeHandle h, std::int32_t g) {
    are_neighbours = are_neighbours || g == to;
    are_glued = are_glued || (g == to && !gluing.IsOutline(h));
  });
  if (are_neighbours) return are_glued;
  std::vector<std::int32_t> reached = {from};
  std::size_t begin = 0;
  for (int step = 0; step < kSteps; ++step) {
    const std::size_t end = reached.size();
    for (std::size_t i = begin; i < end; ++i) {
      ForEachNeighbour(gluing.surface(), reached[i], [&](HalfedgeHandle h, std::int32_t g) {
        if (!gluing.IsOutline(h) && std::find(reached.begin(), reached.end(), g) == reached.end()) reached.push_back(g);
      });
    }
    begin = end;
  }
  return std::find(reached.begin(), reached.end(), to) != reached.end();
}

// The slits of charts: edges between faces of one chart that are not glued.
template <class Visit>
void ForEachSlitEdge(const Gluing& gluing, const std::vector<std::int32_t>& chart, const Visit& visit) {
  for (std::int32_t f = 0; f < std::ssize(chart); ++f) {
    if (chart[f] < 0) continue;
    ForEachNeighbour(gluing.surface(), f, [&](HalfedgeHandle h, std::int32_t g) {
      if (g > f && chart[g] == chart[f] && gluing.IsOutline(h)) visit(h, f, g);
    });
  }
}

// Closes slits that do not reach the outline of their chart.
void CloseInnerSlits(const std::vector<std::int32_t>& chart, Gluing* gluing) {
  const TriMesh& mesh = gluing->mesh();
  std::vector<std::int32_t> root(mesh.n_vertices());
  for (std::int32_t v = 0; v < std::ssize(root); ++v) root[v] = v;
  const auto find = [&](std::int32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  ForEachSlitEdge(*gluing, chart, [&](HalfedgeHandle h, std::int32_t, std::int32_t) {
    const std::int32_t a = find(mesh.from_vertex_handle(h).idx()), b = find(mesh.to_vertex_handle(h).idx());
    root[std::max(a, b)] = std::min(a, b);
  });
  std::vector<char> reaches(root.size(), 0);
  for (std::int32_t f = 0; f < std::ssize(chart); ++f) {
    if (chart[f] < 0) continue;
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) {
      const std::int32_t g = gluing->surface().face_across(h);
      if (g >= 0 && chart[g] == chart[f]) continue;
      for (const VertexHandle v : {mesh.from_vertex_handle(h), mesh.to_vertex_handle(h)}) reaches[find(v.idx())] = 1;
    }
  }
  std::vector<HalfedgeHandle> closed;
  ForEachSlitEdge(*gluing, chart, [&](HalfedgeHandle h, std::int32_t, std::int32_t) {
    if (!reaches[find(mesh.from_vertex_handle(h).idx())]) closed.push_back(h);
  });
  for (const HalfedgeHandle h : closed) gluing->Glue(h);
}

// Closes slits where they cut small pieces off a chart. Gives numbers of their own, from `count` on, to large pieces,
// and opens the edges between faces that are then in different charts.
void JoinSmallPieces(const std::vector<char>& has_slit, std::int32_t* count, std::vector<std::int32_t>* chart,
                     Gluing* gluing) {
  constexpr double kSmallPiece = 0.05;  // of the area of its chart
  const Surface& surface = gluing->surface();
  const auto with_slit = [&](std::int32_t f) { return (*chart)[f] >= 0 && has_slit[(*chart)[f]] != 0; };
  std::int32_t pieces = 0;
  const std::vector<std::int32_t> piece =
      ConnectedPieces(surface.num_faces(), &pieces, with_slit, [&](std::int32_t f, int k) {
        const HalfedgeHandle h = HalfEdgesOf(*surface.mesh, FaceHandle(f))[k];
        return gluing->IsOutline(h) ? -1 : surface.face_across(h);
      });
  std::vector<double> area(pieces, 0.0), whole(has_slit.size(), 0.0);
  std::vector<std::int32_t> largest(has_slit.size(), -1), number(pieces, -1);
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (piece[f] < 0) continue;
    area[piece[f]] += surface.area[f];
    whole[(*chart)[f]] += surface.area[f];
  }
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (piece[f] < 0) continue;
    std::int32_t& most = largest[(*chart)[f]];
    if (most < 0 || area[piece[f]] > area[most]) most = piece[f];
  }
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    const std::int32_t p = piece[f];
    if (p < 0 || p == largest[(*chart)[f]] || area[p] < kSmallPiece * whole[(*chart)[f]]) continue;
    if (number[p] < 0) number[p] = (*count)++;
  }
  std::vector<HalfedgeHandle> closed;
  ForEachSlitEdge(*gluing, *chart, [&](HalfedgeHandle h, std::int32_t f, std::int32_t g) {
    const auto is_small = [&](std::int32_t p) { return p >= 0 && number[p] < 0 && p != largest[(*chart)[f]]; };
    if (piece[f] != piece[g] && (is_small(piece[f]) || is_small(piece[g]))) closed.push_back(h);
  });
  for (const HalfedgeHandle h : closed) gluing->Glue(h);
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (piece[f] >= 0 && number[piece[f]] >= 0) (*chart)[f] = number[piece[f]];
  }
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    ForEachNeighbour(surface, f, [&](HalfedgeHandle h, std::int32_t g) {
      if ((*chart)[g] != (*chart)[f]) gluing->Unglue(h);
    });
  }
}

}  // namespace

Segmentation Segmentation::Like(const Surface& surface, const Segmentation& other, std::vector<std::int32_t> like,
                                const Execution& execution) {
  Segmentation made(surface, other.tuning_);
  made.kept_.assign(surface.mesh->n_vertices(), 0.0F);
  Fill(surface, &like);
  const auto count = static_cast<std::int32_t>(other.faces_.size());
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (!surface.takes_part[f]) continue;
    made.chart_[f] = like[f] < 0 || other.chart_[like[f]] < 0 ? count : other.chart_[like[f]];
  }
  constexpr int kPasses = 4;
  for (int pass = 0; pass < kPasses && MovePieces(surface, count + 1, &made.chart_, &like); ++pass) {
  }
  std::vector<char> has_slit(count + 1, 0);
  for (std::int32_t i = 0; i < count; ++i) has_slit[i] = other.HasSlit(i) ? 1 : 0;
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (made.chart_[f] < 0) continue;
    ForEachNeighbour(surface, f, [&](HalfedgeHandle h, std::int32_t g) {
      if (made.chart_[g] != made.chart_[f] || g < f) return;
      const bool is_glued = surface.is_uncut(h) || !has_slit[made.chart_[f]] || like[f] == like[g] ||
                            AreTogether(other.gluing_, like[f], like[g]);
      if (is_glued) made.gluing_.Glue(h);
    });
  }
  CloseInnerSlits(made.chart_, &made.gluing_);
  std::int32_t total = count + 1;
  JoinSmallPieces(has_slit, &total, &made.chart_, &made.gluing_);
  CloseInnerSlits(made.chart_, &made.gluing_);
  made.faces_.resize(total);
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (made.chart_[f] >= 0) made.faces_[made.chart_[f]].push_back(f);
  }
  made.MakeDiscs();
  SmoothOutlines(made.tuning_, execution, Indices(made.chart_.size()), &made.gluing_, &made.chart_);
  made.CollectFaces();
  return made;
}

}  // namespace planish
