#include "core/unwrap/holes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <span>
#include <utility>

namespace planish {
namespace {

// Sets `piece->loops` and `piece->outer`. Returns whether the piece is planar with holes.
bool IsHoled(HoledPiece* piece) {
  const FlatMesh& mesh = piece->mesh;
  piece->loops = BoundaryLoops(mesh.opposite);
  const std::int64_t edges = (std::ssize(mesh.opposite) + std::ssize(piece->loops.item)) / 2;
  const std::int64_t characteristic = std::ssize(mesh.positions) - edges + std::ssize(mesh.faces);
  if (piece->loops.count() < 2 || characteristic != 2 - piece->loops.count()) return false;
  double longest = -1;
  for (std::int32_t i = 0; i < piece->loops.count(); ++i) {
    double length = 0;
    for (const std::int32_t c : piece->loops[i]) {
      length += (mesh.positions[Target(mesh.faces, c)] - mesh.positions[Origin(mesh.faces, c)]).norm();
    }
    if (length > longest) longest = length, piece->outer = i;
  }
  return true;
}

// Fills a hole: a face on each half-edge of its loop, with corner 2 at a new vertex in the middle.
void AddFan(std::span<const std::int32_t> loop, FlatMesh* mesh) {
  const auto middle = static_cast<std::int32_t>(mesh->positions.size());
  const auto first = static_cast<std::int32_t>(mesh->opposite.size()), n = static_cast<std::int32_t>(loop.size());
  Vec3 sum = Vec3::Zero();
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t from = Origin(mesh->faces, loop[i]), to = Target(mesh->faces, loop[i]);
    sum += mesh->positions[from];
    mesh->faces.push_back({to, from, middle});
    // The neighbours are the face before, the face after, and the face beside the hole.
    mesh->opposite.insert(mesh->opposite.end(),
                          {first + 3 * ((i + n - 1) % n) + 1, first + 3 * ((i + 1) % n), loop[i]});
    mesh->opposite[loop[i]] = first + 3 * i + 2;
  }
  mesh->positions.push_back(sum / static_cast<double>(n));
}

// Finds shortest paths along edges from the reached part of a piece to the next hole.
class HoleSearch {
 public:
  HoleSearch(const HoledPiece& piece, const std::function<double(std::int32_t)>& cost)
      : piece_(piece), cost_(cost), loop_of_(piece.mesh.positions.size(), -1) {
    const std::size_t n = piece.mesh.positions.size();
    distance_.assign(n, std::numeric_limits<double>::infinity());
    from_.assign(n, -1);
    for (std::int32_t i = 0; i < piece.loops.count(); ++i) {
      for (const std::int32_t c : piece.loops[i]) loop_of_[Origin(piece.mesh.faces, c)] = i;
    }
    ListEdges();
  }

  // Returns half-edges, one for each edge of the slits; empty if some hole cannot be reached.
  std::vector<std::int32_t> Run() {
    std::vector<std::int32_t> slits;
    Reach(piece_.outer);
    for (std::int32_t left = piece_.loops.count() - 1; left > 0; --left) {
      const std::int32_t end = NextOnAHole();
      if (end < 0) return {};
      for (std::int32_t v = end, c = from_[v]; c >= 0; c = from_[v]) {
        slits.push_back(c);
        Start(v);
        v = OtherEnd(c, v);
      }
      Reach(loop_of_[end]);
    }
    return slits;
  }

 private:
  // Lists the inner edges at each vertex.
  void ListEdges() {
    const auto& [faces, opposite, positions] = piece_.mesh;
    edges_.resize(positions.size());
    for (std::int32_t c = 0; c < std::ssize(opposite); ++c) {
      if (opposite[c] < c) continue;
      edges_[Origin(faces, c)].push_back(c);
      edges_[Target(faces, c)].push_back(c);
    }
  }

  std::int32_t OtherEnd(std::int32_t c, std::int32_t v) const {
    const std::int32_t origin = Origin(piece_.mesh.faces, c);
    return origin == v ? Target(piece_.mesh.faces, c) : origin;
  }

  // Makes v a possible start of paths.
  void Start(std::int32_t v) {
    distance_[v] = 0;
    from_[v] = -1;
    queue_.emplace(0.0, v);
  }

  void Reach(std::int32_t loop) {
    for (const std::int32_t c : piece_.loops[loop]) {
      loop_of_[Origin(piece_.mesh.faces, c)] = piece_.outer;
      Start(Origin(piece_.mesh.faces, c));
    }
  }

  // The nearest vertex on a hole that is not reached yet; -1 if there is no path to one.
  std::int32_t NextOnAHole() {
    while (!queue_.empty()) {
      const auto [distance, v] = queue_.top();
      if (distance <= distance_[v] && loop_of_[v] >= 0 && loop_of_[v] != piece_.outer) return v;
      queue_.pop();
      if (distance > distance_[v]) continue;
      for (const std::int32_t c : edges_[v]) {
        const std::int32_t to = OtherEnd(c, v);
        const double through = distance + cost_(c);
        if (to == v || !(through < distance_[to])) continue;
        distance_[to] = through;
        from_[to] = c;
        queue_.emplace(through, to);
      }
    }
    return -1;
  }

  const HoledPiece& piece_;
  const std::function<double(std::int32_t)>& cost_;
  std::vector<std::int32_t> loop_of_;  // per vertex: -1 inside; `outer` once reached
  std::vector<std::vector<std::int32_t>> edges_;
  std::vector<double> distance_;
  std::vector<std::int32_t> from_;  // per vertex: the last edge of its path
  using Entry = std::pair<double, std::int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

}  // namespace

std::optional<HoledPiece> HoledPieceOf(const Mesh& mesh, const Chart& chart) {
  if (chart.slits.empty()) return std::nullopt;
  HoledPiece piece;
  piece.mesh.opposite = OppositeWithClosedSlits(chart, Indices(chart.slits.size()));
  piece.mesh.faces = FacesOfFans(piece.mesh.opposite, [&](std::int32_t c) {
    piece.mesh.positions.push_back(mesh.positions[mesh.faces[chart.faces[c / 3]][c % 3]]);
  });
  if (!IsHoled(&piece)) return std::nullopt;
  return piece;
}

void SlitAlongShortPaths(const std::function<double(std::int32_t)>& cost, FlatMesh* disc,
                         std::vector<std::pair<std::int32_t, std::int32_t>>* slits) {
  if (slits->empty()) return;
  const auto position = [disc](std::int32_t c) { return disc->positions[disc->faces[c / 3][c % 3]]; };
  HoledPiece piece;
  piece.mesh.opposite = disc->opposite;
  for (const auto& [c, d] : *slits) piece.mesh.opposite[c] = d, piece.mesh.opposite[d] = c;
  piece.mesh.faces =
      FacesOfFans(piece.mesh.opposite, [&](std::int32_t c) { piece.mesh.positions.push_back(position(c)); });
  if (!IsHoled(&piece)) return;
  const std::vector<std::int32_t> paths = HoleSearch(piece, cost).Run();
  if (paths.empty()) return;
  FlatMesh cut;
  cut.opposite = std::move(piece.mesh.opposite);
  slits->clear();
  for (const std::int32_t c : paths) {
    slits->push_back(std::minmax({c, cut.opposite[c]}));
    cut.opposite[cut.opposite[c]] = -1;
    cut.opposite[c] = -1;
  }
  std::sort(slits->begin(), slits->end());
  cut.faces = FacesOfFans(cut.opposite, [&](std::int32_t c) { cut.positions.push_back(position(c)); });
  *disc = std::move(cut);
}

std::optional<FilledChart> FillHoles(const Mesh& mesh, const Chart& chart, const Execution& execution) {
  std::optional<HoledPiece> piece = HoledPieceOf(mesh, chart);
  if (!piece) return std::nullopt;
  for (std::int32_t i = 0; i < piece->loops.count(); ++i) {
    if (piece->loops[i].size() < 3) return std::nullopt;
  }
  for (std::int32_t i = 0; i < piece->loops.count(); ++i) {
    if (i != piece->outer) AddFan(piece->loops[i], &piece->mesh);
  }
  FilledChart filled;
  std::vector<std::int32_t> order;
  filled.topology = MakeTopology(piece->mesh, &order, execution);
  filled.places = std::move(piece->mesh.positions);
  for (const std::int32_t f : order) {
    for (std::int32_t k = 0; k < 3; ++k) filled.corner.push_back(f < chart.topology->num_faces() ? 3 * f + k : -1);
  }
  return filled;
}

}  // namespace planish
