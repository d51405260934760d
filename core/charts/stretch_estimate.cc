#include "core/charts/stretch_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/base/portable_math.h"

namespace planish {
namespace {

double AsKept(double u) {
  return static_cast<double>(static_cast<float>(u));
}
// The factor by which areas grow where lengths are multiplied by e^u.
double ScaleOf(double u) {
  return u == 0 ? 1.0 : portable::Exp(2 * u);
}

// The angle that faces half-edge h, where the two smaller angles of its face count as at least `least`, and the largest
// as the rest. With the cotangents of a triangle, L is positive semidefinite; limited one by one, they would be none.
double AngleFacing(const TriMesh& mesh, const std::vector<double>& angles, HalfedgeHandle h, double least) {
  const double angle = angles[h.idx()];
  const double next = angles[mesh.next_halfedge_handle(h).idx()], previous = angles[mesh.prev_halfedge_handle(h).idx()];
  if (angle < next || angle < previous) return std::max(angle, least);
  return std::numbers::pi - std::max(next, least) - std::max(previous, least);
}

}  // namespace

StretchEstimate::StretchEstimate(const Gluing& gluing, const AtlasTuning& tuning, std::vector<float> kept,
                                 const Execution& execution)
    : gluing_(gluing),
      tuning_(tuning),
      weight_(gluing.mesh().n_edges(), 0.0),
      vertices_(gluing.mesh().n_vertices() + 1),
      number_(gluing.mesh().n_vertices(), -1),
      kept_(std::move(kept)),
      is_marked_(gluing.mesh().n_faces(), 0) {
  const TriMesh& mesh = gluing.mesh();
  const Surface& surface = gluing.surface();
  const double most = tuning.estimate_cotangent;
  kept_.resize(mesh.n_vertices(), 0.0F);
  for (Vertex& vertex : vertices_) vertex.load = -2 * std::numbers::pi;
  for (const FaceHandle f : mesh.faces()) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(mesh, f);
    for (int k = 0; k < 3; ++k) {
      Vertex& vertex = vertices_[mesh.to_vertex_handle(half_edges[Next(k)]).idx()];
      vertex.load += surface.angle[half_edges[k].idx()];
      vertex.area += surface.area[f.idx()] / 3;
    }
  }
  execution.ForEach(std::ssize(weight_), [&](std::int64_t e) {
    for (const unsigned side : {0U, 1U}) {
      const HalfedgeHandle h = mesh.halfedge_handle(EdgeHandle(static_cast<int>(e)), side);
      if (mesh.is_boundary(h)) continue;
      const auto [sine, cosine] = portable::SinCosInTriangle(AngleFacing(mesh, surface.angle, h, 1 / most));
      weight_[e] += cosine / sine / 2;
    }
  });
  const auto ends = [&](EdgeHandle e) {
    const HalfedgeHandle h = mesh.halfedge_handle(e, 0);
    return std::array{mesh.from_vertex_handle(h).idx(), mesh.to_vertex_handle(h).idx()};
  };
  for (const EdgeHandle e : mesh.edges()) {
    for (const std::int32_t v : ends(e)) {
      ++vertices_[v].begin;
      vertices_[v].diagonal += weight_[e.idx()];
    }
  }
  // Sets `begin` to the end of each vertex's neighbours; the loop below counts it down to their beginning.
  for (std::size_t v = 1; v < vertices_.size(); ++v) vertices_[v].begin += vertices_[v - 1].begin;
  neighbours_.resize(2 * mesh.n_edges());
  for (const EdgeHandle e : mesh.edges()) {
    const auto [from, to] = ends(e);
    neighbours_[--vertices_[from].begin] = {to, e.idx()};
    neighbours_[--vertices_[to].begin] = {from, e.idx()};
  }
}

double StretchEstimate::Sums::Stretch() const {
  if (!(area > 0)) return 1;
  const double stretch = std::sqrt(larger / area) * std::sqrt(smaller / area);
  return std::isfinite(stretch) ? std::max(1.0, stretch) : std::numeric_limits<double>::infinity();
}

std::vector<std::int32_t> StretchEstimate::InteriorOf(std::span<const std::int32_t> faces) {
  std::vector<std::int32_t> interior;
  for (const std::int32_t f : faces) {
    for (const VertexHandle v : VerticesOf(gluing_.mesh(), FaceHandle(f))) {
      if (!gluing_.IsInside(v) || number_[v.idx()] >= 0) continue;
      number_[v.idx()] = 0;
      interior.push_back(v.idx());
    }
  }
  for (const std::int32_t v : interior) number_[v] = -1;
  return interior;
}

// Makes these vertices the unknowns: stores them in Work::free_, and their numbers in number_.
void StretchEstimate::Take(Parts vertices, Work* work) {
  work->free_.clear();
  for (const std::span<const std::int32_t> part : vertices) {
    for (const std::int32_t v : part) {
      number_[v] = static_cast<std::int32_t>(work->free_.size());
      work->free_.push_back(v);
    }
  }
}

// Solves for u at the vertices of Work::free_, which have no numbers afterwards. Returns `sums`, which hold for the
// kept u there or for u = 0, updated to the solution.
StretchEstimate::Sums StretchEstimate::SolveFor(Sums sums, bool from_kept, Work* work) {
  const std::vector<std::int32_t>& free = work->free_;
  PoissonSolver& solver = work->solver_;
  const auto count = static_cast<std::int32_t>(free.size());
  work->capacity_ = std::max(work->capacity_, count);
  solver.Start(count);
  for (const std::int32_t v : free) {
    // The diagonal of L is positive except with degenerate triangles.
    const double diagonal = vertices_[v].diagonal > 0 ? vertices_[v].diagonal : 1;
    solver.AddRow(diagonal, KeptAt(v), [&](const auto& add) {
      double load = vertices_[v].load;
      for (const auto& [w, edge] : NeighboursOf(v)) {
        if (number_[w] >= 0) {
          add(number_[w], weight_[edge]);
        } else if (gluing_.IsInside(VertexHandle(w))) {
          load += weight_[edge] * KeptAt(w);
        }
      }
      return load;
    });
  }
  solver.Solve(tuning_.estimate_tolerance, tuning_.estimate_iterations);
  const std::vector<double>& u = solver.solution();
  for (std::size_t i = 0; i < free.size(); ++i) {
    const double was = from_kept ? ScaleOf(KeptAt(free[i])) : 1, is = ScaleOf(AsKept(u[i]));
    sums.larger += vertices_[free[i]].area * (is - was);
    sums.smaller += vertices_[free[i]].area * (1 / is - 1 / was);
    number_[free[i]] = -1;
  }
  return sums;
}

StretchEstimate::Sums StretchEstimate::Whole(Parts interior, double area, Work* work) {
  Take(interior, work);
  return SolveFor({area, area, area}, /*from_kept=*/false, work);
}

StretchEstimate::Sums StretchEstimate::Joined(std::span<const std::int32_t> small, const Sums& before, Work* work) {
  const TriMesh& mesh = gluing_.mesh();
  std::vector<std::int32_t>& faces = work->faces_;
  faces.assign(small.begin(), small.end());
  for (const std::int32_t f : faces) is_marked_[f] = 1;
  const std::size_t most = small.size() * (1 + static_cast<std::size_t>(tuning_.estimate_reach));
  for (std::size_t i = 0; i < faces.size() && faces.size() < most; ++i) {
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(faces[i]))) {
      const HalfedgeHandle across = gluing_.Across(h);
      if (!across.is_valid()) continue;
      const std::int32_t f = mesh.face_handle(across).idx();
      if (std::exchange(is_marked_[f], 1) == 0) faces.push_back(f);
    }
  }
  Take({}, work);
  // The unknowns are the vertices inside the disc all of whose faces are in Work::faces_. Counts these faces in
  // number_, from -1 downwards.
  const auto for_each_corner = [&](const auto& visit) {
    for (const std::int32_t f : faces) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) visit(mesh.to_vertex_handle(h));
    }
  };
  for_each_corner([&](VertexHandle v) { --number_[v.idx()]; });
  for_each_corner([&](VertexHandle v) {
    std::int32_t& number = number_[v.idx()];
    if (number >= 0) return;
    const auto count = static_cast<std::size_t>(-1 - std::exchange(number, -1));
    if (!gluing_.IsInside(v) || count != NeighboursOf(v.idx()).size()) return;
    number = static_cast<std::int32_t>(work->free_.size());
    work->free_.push_back(v.idx());
  });
  for (const std::int32_t f : faces) is_marked_[f] = 0;
  return SolveFor(before, /*from_kept=*/true, work);
}

// Edges keep their lengths, since u = 0 on the outline. At a vertex the outline turns by pi, minus the angles of the
// faces there, minus the flux of u. All turns add up to 2 pi (boundary first flattening, Sawhney and Crane 2017).
std::vector<Vec2> StretchEstimate::Outline(std::span<const HalfedgeHandle> outline) const {
  const Surface& surface = gluing_.surface();
  std::vector<Vec2> points;
  std::vector<double> travelled;
  Vec2 at = Vec2::Zero();
  double direction = 0, length = 0;
  for (const HalfedgeHandle h : outline) {
    direction += std::numbers::pi;
    ForEachInFan(gluing_, gluing_.Next(h), [&](HalfedgeHandle facing) {
      direction -= surface.angle[facing.idx()];
      const HalfedgeHandle edge = gluing_.Next(facing);  // to this vertex
      if (gluing_.IsOutline(edge)) return;
      const VertexHandle v = gluing_.mesh().from_vertex_handle(edge);
      if (gluing_.IsInside(v)) direction -= weight_[edge.idx() / 2] * KeptAt(v.idx());
    });
    points.push_back(at);
    travelled.push_back(length);
    const auto [sine, cosine] = portable::SinCos(direction);
    const double along = surface.length(h);
    at += along * Vec2(cosine, sine);
    length += along;
  }
  for (std::size_t i = 0; i < points.size(); ++i) points[i] -= travelled[i] / length * at;
  return points;
}

StretchEstimate::Kept StretchEstimate::Replace(const Work& work) {
  Kept before = {work.free_, {}};
  before.u.reserve(work.free_.size());
  for (const std::int32_t v : work.free_) before.u.push_back(kept_[v]);
  Keep(work);
  return before;
}

void StretchEstimate::Swap(Kept* kept) {
  for (std::size_t i = 0; i < kept->u.size(); ++i) std::swap(kept_[kept->vertices[i]], kept->u[i]);
}

void StretchEstimate::Keep(const Work& work) {
  for (std::size_t i = 0; i < work.free_.size(); ++i) {
    kept_[work.free_[i]] = static_cast<float>(work.solver_.solution()[i]);
  }
}

}  // namespace planish
