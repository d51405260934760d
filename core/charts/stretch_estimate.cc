#include "core/charts/stretch_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/portable_math.h"

namespace planish {
namespace {

// Vertices that are not solved for.
constexpr std::int32_t kOutline = -2;  // u = 0
constexpr std::int32_t kFixed = -3;    // u as kept
constexpr std::int32_t kUnknown = -1;

double AsKept(double u) {
  return static_cast<double>(static_cast<float>(u));
}
// Of areas where lengths are multiplied by e^u.
double ScaleOf(double u) {
  return u == 0 ? 1.0 : portable::Exp(2 * u);
}

}  // namespace

StretchEstimate::StretchEstimate(const Gluing& gluing, const AtlasTuning& tuning)
    : gluing_(gluing),
      tuning_(tuning),
      cotangent_(gluing.mesh().n_halfedges()),
      vertex_(cotangent_.size(), kUnknown),
      kept_(cotangent_.size(), 0.0F),
      is_marked_(gluing.mesh().n_faces(), 0) {
  const std::vector<double>& angle = gluing.surface().angle;
  const double most = tuning.estimate_cotangent;
  for (std::size_t h = 0; h < angle.size(); ++h) {
    const auto [sine, cosine] = portable::SinCos(angle[h]);
    cotangent_[h] = std::clamp(sine > 0 ? cosine / sine : most, -most, most);
  }
}

double StretchEstimate::Sums::Stretch() const {
  if (!(area > 0)) return 1;
  const double stretch = std::sqrt(larger / area) * std::sqrt(smaller / area);
  return std::isfinite(stretch) ? std::max(1.0, stretch) : std::numeric_limits<double>::infinity();
}

void StretchEstimate::Mark(std::span<const std::int32_t> faces) {
  for (const std::int32_t f : faces) {
    is_marked_[f] = 1;
    faces_.push_back(f);
  }
}

// Vertices whose faces are all at hand are solved for.
void StretchEstimate::NumberVertices() {
  const TriMesh& mesh = gluing_.mesh();
  for (const std::int32_t f : faces_) {
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) vertex_[h.idx()] = kUnknown;
  }
  num_free_ = 0;
  for (const std::int32_t f : faces_) {
    for (const HalfedgeHandle start : HalfEdgesOf(mesh, FaceHandle(f))) {
      if (vertex_[start.idx()] != kUnknown) continue;
      fan_.clear();
      bool is_whole = true;
      const bool is_interior = ForEachInFan(gluing_, start, [&](HalfedgeHandle h) {
        fan_.push_back(h);
        is_whole = is_whole && is_marked_[mesh.face_handle(h).idx()];
      });
      const std::int32_t number = !is_interior ? kOutline : is_whole ? num_free_++ : kFixed;
      for (const HalfedgeHandle h : fan_) vertex_[h.idx()] = number;
    }
  }
}

void StretchEstimate::Assemble() {
  const TriMesh& mesh = gluing_.mesh();
  const std::vector<double>& angle = gluing_.surface().angle;
  load_.assign(num_free_, -2 * std::numbers::pi);
  diagonal_.assign(num_free_, 0.0);
  u_.assign(num_free_, 0.0);
  edges_.clear();
  for (const std::int32_t f : faces_) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(mesh, FaceHandle(f));
    for (int k = 0; k < 3; ++k) {
      const std::int32_t h = half_edges[k].idx(), v = vertex_[h];
      if (v >= 0) {
        load_[v] += angle[h];
        u_[v] = KeptAt(h);
      }
      const HalfedgeHandle o = gluing_.Across(half_edges[k]);
      // On the outline, seen from the other side, or away from all that is solved for.
      if (!o.is_valid() || o.idx() < h || !is_marked_[mesh.face_handle(o).idx()]) continue;
      const double weight = (cotangent_[h] + cotangent_[o.idx()]) / 2;
      const std::int32_t next = half_edges[Next(k)].idx(), prev = half_edges[Prev(k)].idx();
      const std::int32_t from = vertex_[next], to = vertex_[prev];
      if (from >= 0) diagonal_[from] += weight;
      if (to >= 0) diagonal_[to] += weight;
      if (from >= 0 && to >= 0) {
        edges_.push_back({from, to, weight});
      } else if (from >= 0 && to == kFixed) {
        load_[from] += weight * KeptAt(prev);
      } else if (to >= 0 && from == kFixed) {
        load_[to] += weight * KeptAt(next);
      }
    }
  }
}

void StretchEstimate::Solve() {
  const std::int32_t n = num_free_;
  residual_.resize(n);
  direction_.resize(n);
  product_.resize(n);
  const auto multiply = [&](const std::vector<double>& x) {
    for (std::int32_t i = 0; i < n; ++i) product_[i] = diagonal_[i] * x[i];
    for (const Edge& e : edges_) {
      product_[e.from] -= e.weight * x[e.to];
      product_[e.to] -= e.weight * x[e.from];
    }
  };
  // Conjugate gradients with the diagonal. Positive unless triangles are hopeless.
  double norm = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    if (!(diagonal_[i] > 0)) diagonal_[i] = 1;
    norm += load_[i] * load_[i] / diagonal_[i];
  }
  multiply(u_);
  double rho = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    residual_[i] = load_[i] - product_[i];
    direction_[i] = residual_[i] / diagonal_[i];
    rho += residual_[i] * direction_[i];
  }
  const double enough = tuning_.estimate_tolerance * tuning_.estimate_tolerance * norm;
  for (int iteration = 0; iteration < tuning_.estimate_iterations && rho > enough; ++iteration) {
    multiply(direction_);
    double curvature = 0;
    for (std::int32_t i = 0; i < n; ++i) curvature += direction_[i] * product_[i];
    if (!(curvature > 0)) break;
    const double step = rho / curvature;
    double next_rho = 0;
    for (std::int32_t i = 0; i < n; ++i) {
      u_[i] += step * direction_[i];
      residual_[i] -= step * product_[i];
      next_rho += residual_[i] * residual_[i] / diagonal_[i];
    }
    const double beta = next_rho / rho;
    for (std::int32_t i = 0; i < n; ++i) direction_[i] = residual_[i] / diagonal_[i] + beta * direction_[i];
    rho = next_rho;
  }
}

double StretchEstimate::SolvedAt(std::int32_t half_edge) const {
  const std::int32_t v = vertex_[half_edge];
  return v >= 0 ? AsKept(u_[v]) : v == kFixed ? KeptAt(half_edge) : 0.0;
}

template <typename Scale>
StretchEstimate::Sums StretchEstimate::SumUp(const Scale& scale_at) const {
  Sums sums;
  for (const std::int32_t f : faces_) {
    const double third = gluing_.surface().area[f] / 3;
    for (const HalfedgeHandle h : HalfEdgesOf(gluing_.mesh(), FaceHandle(f))) {
      const double scale = scale_at(h.idx());
      sums.larger += third * scale;
      sums.smaller += third / scale;
    }
    sums.area += 3 * third;
  }
  return sums;
}

StretchEstimate::Sums StretchEstimate::SumUpSolved() {
  scale_.resize(num_free_);
  for (std::int32_t i = 0; i < num_free_; ++i) scale_[i] = ScaleOf(AsKept(u_[i]));
  return SumUp([&](std::int32_t h) {
    const std::int32_t v = vertex_[h];
    return v >= 0 ? scale_[v] : v == kFixed ? ScaleOf(KeptAt(h)) : 1.0;
  });
}

StretchEstimate::Sums StretchEstimate::Whole(std::span<const std::int32_t> first,
                                             std::span<const std::int32_t> second) {
  faces_.clear();
  Mark(first);
  Mark(second);
  NumberVertices();
  Assemble();
  Solve();
  for (const std::int32_t f : faces_) is_marked_[f] = 0;
  return SumUpSolved();
}

StretchEstimate::Sums StretchEstimate::Joined(std::span<const std::int32_t> small, const Sums& before) {
  faces_.clear();
  Mark(small);
  const std::size_t most = small.size() * (1 + static_cast<std::size_t>(tuning_.estimate_reach));
  for (std::size_t i = 0; i < faces_.size() && faces_.size() < most; ++i) {
    for (const HalfedgeHandle h : HalfEdgesOf(gluing_.mesh(), FaceHandle(faces_[i]))) {
      const HalfedgeHandle across = gluing_.Across(h);
      if (!across.is_valid()) continue;
      if (const std::int32_t f = gluing_.mesh().face_handle(across).idx(); !is_marked_[f]) Mark({&f, 1});
    }
  }
  NumberVertices();
  Assemble();
  Solve();
  for (const std::int32_t f : faces_) is_marked_[f] = 0;
  const Sums was = SumUp([&](std::int32_t h) { return ScaleOf(KeptAt(h)); });
  const Sums is = SumUpSolved();
  return {before.area, before.larger + is.larger - was.larger, before.smaller + is.smaller - was.smaller};
}

// Where u = 0 lengths are kept; the turn at a vertex of the outline is what the faces leave of pi, and the flux of u.
// All turns add up to 2 pi (boundary first flattening, Sawhney and Crane 2017).
std::vector<Vec2> StretchEstimate::Outline(std::span<const HalfedgeHandle> outline) const {
  const Surface& surface = gluing_.surface();
  std::vector<Vec2> points;
  std::vector<double> travelled;
  Vec2 at = Vec2::Zero();
  double direction = 0, length = 0;
  for (const HalfedgeHandle h : outline) {
    direction += std::numbers::pi;
    ForEachInFan(gluing_, gluing_.Next(h), [&](HalfedgeHandle facing) {
      const int next = gluing_.Next(facing).idx(), prev = gluing_.Prev(facing).idx();
      direction -= surface.angle[facing.idx()];
      direction -= (cotangent_[prev] * SolvedAt(next) + cotangent_[next] * SolvedAt(prev)) / 2;
    });
    points.push_back(at);
    travelled.push_back(length);
    const auto [sine, cosine] = portable::SinCos(direction);
    at += surface.length(h) * Vec2(cosine, sine);
    length += surface.length(h);
  }
  for (std::size_t i = 0; i < points.size(); ++i) points[i] -= travelled[i] / length * at;
  return points;
}

std::vector<Vec2> StretchEstimate::Inside(std::span<const std::int32_t> faces, std::span<const HalfedgeHandle> outline,
                                          std::span<const Vec2> points) {
  const TriMesh& mesh = gluing_.mesh();
  faces_.clear();
  Mark(faces);
  NumberVertices();
  Assemble();
  for (const std::int32_t f : faces_) is_marked_[f] = 0;
  place_.resize(vertex_.size());
  for (std::size_t i = 0; i < outline.size(); ++i) {
    ForEachInFan(gluing_, gluing_.Next(outline[i]), [&](HalfedgeHandle h) { place_[h.idx()] = points[i]; });
  }
  // Harmonic: each vertex is the weighted mean of its neighbours.
  for (int axis = 0; axis < 2; ++axis) {
    load_.assign(num_free_, 0.0);
    u_.assign(num_free_, 0.0);
    for (const std::int32_t f : faces_) {
      const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(mesh, FaceHandle(f));
      for (int k = 0; k < 3; ++k) {
        if (gluing_.IsOutline(half_edges[k])) continue;
        const std::int32_t next = half_edges[Next(k)].idx(), prev = half_edges[Prev(k)].idx();
        const double weight = cotangent_[half_edges[k].idx()] / 2;
        if (vertex_[next] >= 0 && vertex_[prev] < 0) load_[vertex_[next]] += weight * place_[prev][axis];
        if (vertex_[prev] >= 0 && vertex_[next] < 0) load_[vertex_[prev]] += weight * place_[next][axis];
      }
    }
    Solve();
    for (const std::int32_t f : faces_) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) {
        if (vertex_[h.idx()] >= 0) place_[h.idx()][axis] = u_[vertex_[h.idx()]];
      }
    }
  }
  std::vector<Vec2> corners;
  for (const std::int32_t f : faces_) {
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) corners.push_back(place_[h.idx()]);
  }
  return corners;
}

void StretchEstimate::Keep() {
  for (const std::int32_t f : faces_) {
    for (const HalfedgeHandle h : HalfEdgesOf(gluing_.mesh(), FaceHandle(f))) {
      kept_[h.idx()] = static_cast<float>(SolvedAt(h.idx()));
    }
  }
}

}  // namespace planish
