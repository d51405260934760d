#include "core/charts/segmentation.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <limits>
#include <queue>
#include <utility>

#include "core/charts/steps.h"

namespace planish {
namespace {

Vec3 Centre(const TriMesh& mesh, std::int32_t f) {
  const std::array<VertexHandle, 3> v = VerticesOf(mesh, FaceHandle(f));
  return (mesh.point(v[0]) + mesh.point(v[1]) + mesh.point(v[2])) / 3;
}

// Distances within a chart, from face centre to face centre, without crossing its slits. Faces that must not be parted
// are one place.
class Distances {
 public:
  explicit Distances(const Gluing& gluing, Segmentation::Scratch* scratch)
      : gluing_(gluing), distance_(scratch->distance), source_(scratch->source) {}

  // From the nearest of `sources`, the first one of several, to all faces of their chart: along the surface, or as the
  // number of edges between them.
  enum class Measure { kLength, kEdges };
  void From(const std::vector<std::int32_t>& sources, Measure measure) {
    using Entry = std::pair<Nearness, std::int32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    const auto reach = [&](const Nearness& there, std::int32_t f) {
      if (!(there < At(f))) return;
      distance_[f] = there.first;
      source_[f] = there.second;
      queue.emplace(there, f);
    };
    for (std::size_t i = 0; i < sources.size(); ++i) reach({0.0, static_cast<std::int32_t>(i)}, sources[i]);
    while (!queue.empty()) {
      const auto [nearness, f] = queue.top();
      queue.pop();
      if (At(f) < nearness) continue;
      const TriMesh& mesh = gluing_.mesh();
      const Vec3 centre = Centre(mesh, f);
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) {
        if (gluing_.IsOutline(h)) continue;
        const std::int32_t g = gluing_.surface().face_across(h);
        const double length = measure == Measure::kEdges ? 1 : (centre - Centre(mesh, g)).norm();
        const double step = gluing_.surface().is_uncut(h) ? 0 : length;
        reach({nearness.first + step, nearness.second}, g);
      }
    }
  }

  // The farthest of these faces, the lowest of several.
  std::int32_t Farthest(const std::vector<std::int32_t>& faces) const {
    return *std::max_element(faces.begin(), faces.end(),
                             [&](std::int32_t f, std::int32_t g) { return distance_[f] < distance_[g]; });
  }
  // Which of the sources is nearest, as an index.
  std::int32_t source(std::int32_t f) const { return source_[f]; }

  void Forget(const std::vector<std::int32_t>& faces) {
    for (const std::int32_t f : faces) distance_[f] = kFar;
  }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  using Nearness = std::pair<double, std::int32_t>;  // distance, source
  Nearness At(std::int32_t f) const { return {distance_[f], source_[f]}; }

  const Gluing& gluing_;
  std::vector<double>& distance_;
  std::vector<std::int32_t>& source_;
};

// Which half of a chart each of its faces belongs to, 0 or 1: with the nearer one of two faces, or, if these are
// -1 or cannot be parted, of two about as far from each other as faces of this chart can be. All 0 if no face can
// be parted from another.
std::vector<std::int32_t> Halve(const std::vector<std::int32_t>& faces, std::int32_t face, std::int32_t other_face,
                                Distances* distances) {
  using enum Distances::Measure;
  // Of the faces in the smaller half. Where triangles are of very different sizes, one of them may be as long as all
  // others together, and cutting off one after the other would take as many rounds as there are.
  constexpr std::ptrdiff_t kLeastShare = 16;
  std::vector<std::int32_t> half(faces.size());
  std::ptrdiff_t count = 0;
  const auto part = [&](std::int32_t first, std::int32_t second, Distances::Measure measure) {
    distances->From({first, second}, measure);
    for (std::size_t i = 0; i < faces.size(); ++i) half[i] = distances->source(faces[i]) == 1 ? 1 : 0;
    distances->Forget(faces);
    count = std::count(half.begin(), half.end(), 1);
    return count > 0;
  };
  if (face >= 0 && part(face, other_face, kLength)) return half;
  const auto farthest_from = [&](std::int32_t f, Distances::Measure measure) {
    distances->From({f}, measure);
    const std::int32_t farthest = distances->Farthest(faces);
    distances->Forget(faces);
    return farthest;
  };
  for (const Distances::Measure measure : {kLength, kEdges}) {
    const std::int32_t first = farthest_from(faces.front(), measure);
    part(first, farthest_from(first, measure), measure);
    if (kLeastShare * std::min(count, std::ssize(faces) - count) >= std::ssize(faces)) break;
  }
  return half;
}

}  // namespace

Segmentation::Segmentation(const Surface& surface, Kind kind, double max_stretch, const Execution& execution,
                           const AtlasTuning& tuning)
    : surface_(surface), tuning_(tuning), gluing_(surface) {
  if (kind == Kind::kWhole) {
    std::int32_t count = 0;
    chart_ = ConnectedPieces(
        surface.num_faces(), &count, [&](std::int32_t f) { return surface.takes_part[f] != 0; },
        [&](std::int32_t f, int k) { return surface.face_across(HalfEdgesOf(*surface.mesh, FaceHandle(f))[k]); });
    GluePieces(chart_, &gluing_);
  } else {
    chart_ = MakePatches(surface, tuning, execution);
    if (execution.IsCancelled()) return;
    const std::int32_t count = chart_.empty() ? 0 : *std::max_element(chart_.begin(), chart_.end()) + 1;
    GluePieces(chart_, &gluing_);
    MergeDiscs(count, max_stretch, tuning, execution, &gluing_, &chart_, &kept_);
    SmoothOutlines(tuning_, execution, AllFaces(), &gluing_, &chart_);
  }
  CollectFaces();
}

Segmentation::Segmentation(const Surface& surface, const Segmentation& before, double max_stretch,
                           const Execution& execution)
    : surface_(surface),
      tuning_(before.tuning_),
      gluing_(surface),
      chart_(before.chart_),
      kept_(surface.mesh->n_vertices()) {
  const TriMesh &mesh = *surface.mesh, &mesh_before = *before.surface_.mesh;
  for (std::int32_t c = 0; c < 3 * surface.num_faces(); ++c) {
    const HalfedgeHandle h = HalfEdgeOf(mesh, c), h_before = HalfEdgeOf(mesh_before, c);
    if (!before.gluing_.IsOutline(h_before)) gluing_.Glue(h);
    kept_[mesh.to_vertex_handle(h).idx()] = before.kept_[mesh_before.to_vertex_handle(h_before).idx()];
  }
  MergeDiscs(static_cast<std::int32_t>(before.faces_.size()), max_stretch, tuning_, execution, &gluing_, &chart_,
             &kept_);
  SmoothOutlines(tuning_, execution, AllFaces(), &gluing_, &chart_);
  CollectFaces();
}

std::vector<std::int32_t> Segmentation::AllFaces() const {
  std::vector<std::int32_t> faces;
  for (std::int32_t f = 0; f < surface_.num_faces(); ++f) {
    if (chart_[f] >= 0) faces.push_back(f);
  }
  return faces;
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
  return std::any_of(faces_[chart].begin(), faces_[chart].end(), [&](std::int32_t f) {
    const std::array<HalfedgeHandle, 3> half_edges = HalfEdgesOf(*surface_.mesh, FaceHandle(f));
    return std::any_of(half_edges.begin(), half_edges.end(), [&](HalfedgeHandle h) {
      const std::int32_t across = surface_.face_across(h);
      return gluing_.IsOutline(h) && across >= 0 && chart_[across] == chart;
    });
  });
}

// Whether connected faces make a disc, as Euler's characteristic tells. `is_seen`, per half-edge, is all 0 before and
// after.
bool Segmentation::IsDisc(const std::vector<std::int32_t>& faces, std::vector<char>* is_seen) const {
  std::int64_t vertices = 0, doubled_edges = 0;
  for (const std::int32_t f : faces) {
    for (const HalfedgeHandle h : HalfEdgesOf(*surface_.mesh, FaceHandle(f))) {
      doubled_edges += gluing_.IsOutline(h) ? 2 : 1;
      if ((*is_seen)[h.idx()]) continue;
      ++vertices;
      ForEachInFan(gluing_, h, [&](HalfedgeHandle facing) { (*is_seen)[facing.idx()] = 1; });
    }
  }
  for (const std::int32_t f : faces) {
    for (const HalfedgeHandle h : HalfEdgesOf(*surface_.mesh, FaceHandle(f))) (*is_seen)[h.idx()] = 0;
  }
  return vertices + static_cast<std::int64_t>(faces.size()) == doubled_edges / 2 + 1;
}

std::vector<std::int32_t> Segmentation::Split(const std::vector<Cut>& cuts, const Execution& execution) {
  if (scratch_.moving.empty()) {
    scratch_.distance.assign(chart_.size(), std::numeric_limits<double>::infinity());
    scratch_.source.assign(chart_.size(), -1);
    scratch_.moving.assign(chart_.size(), -1);
    scratch_.is_seen.assign(surface_.mesh->n_halfedges(), 0);
    scratch_.is_glued.assign(chart_.size(), 0);
  }
  Distances distances(gluing_, &scratch_);
  std::vector<std::int32_t> changed;
  for (const auto& [chart, face, other_face, given] : cuts) {
    if (faces_[chart].size() < 2 || execution.IsCancelled()) continue;
    const std::vector<std::int32_t> faces = faces_[chart];
    const std::vector<std::int32_t> part = given.empty() ? Halve(faces, face, other_face, &distances) : given;
    const std::int32_t last = *std::max_element(part.begin(), part.end());
    if (last == 0) continue;
    const auto added = static_cast<std::int32_t>(faces_.size());
    faces_.resize(faces_.size() + last);
    faces_[chart].clear();
    for (std::size_t i = 0; i < faces.size(); ++i) {
      chart_[faces[i]] = part[i] == 0 ? chart : added + part[i] - 1;
      faces_[chart_[faces[i]]].push_back(faces[i]);
    }
    for (const std::int32_t f : faces) {
      for (const HalfedgeHandle h : HalfEdgesOf(*surface_.mesh, FaceHandle(f))) {
        if (!gluing_.IsOutline(h) && chart_[surface_.face_across(h)] != chart_[f]) gluing_.Unglue(h);
      }
    }
    for (std::int32_t k = 0; k <= last; ++k) {
      const std::int32_t number = k == 0 ? chart : added + k - 1;
      changed.push_back(number);
      if (IsDisc(faces_[number], &scratch_.is_seen)) continue;
      // It runs round another part.
      for (const std::int32_t f : faces_[number]) {
        for (const HalfedgeHandle h : HalfEdgesOf(*surface_.mesh, FaceHandle(f))) gluing_.Unglue(h);
      }
      GluePiece(faces_[number].front(), chart_, &scratch_.is_glued, &gluing_);
      for (const std::int32_t f : faces_[number]) scratch_.is_glued[f] = 0;
    }
  }
  std::vector<std::int32_t> faces;
  for (const std::int32_t i : changed) {
    faces.insert(faces.end(), faces_[i].begin(), faces_[i].end());
    faces_[i].clear();
  }
  std::sort(faces.begin(), faces.end());
  std::vector<std::int32_t>& moving = scratch_.moving;
  for (const std::int32_t f : faces) moving[f] = chart_[f];
  SmoothOutlines(tuning_, execution, faces, &gluing_, &moving);
  for (const std::int32_t f : faces) {
    chart_[f] = std::exchange(moving[f], -1);
    faces_[chart_[f]].push_back(f);
  }
  std::sort(changed.begin(), changed.end());
  return changed;
}

std::vector<Segmentation::Joint> Segmentation::Joints() const {
  std::vector<Joint> joints;
  std::vector<std::vector<HalfedgeHandle>> outlines;
  for (const std::vector<std::int32_t>& faces : faces_) {
    outlines.push_back(faces.empty() ? std::vector<HalfedgeHandle>()
                                     : OutlineFrom(gluing_, FirstOnOutline(gluing_, faces)));
  }
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(faces_.size()); ++i) {
    if (faces_[i].empty()) continue;
    for (const auto& [begin, edges, other] : BordersAlong(gluing_, chart_, outlines[i])) {
      if (other < i || std::ssize(outlines[i]) + std::ssize(outlines[other]) - 2 * edges < 3) continue;
      Joint joint = {i, other, {}};
      for (std::int32_t k = 0; k < edges; ++k) {
        joint.border.push_back(outlines[i][static_cast<std::size_t>(begin + k) % outlines[i].size()]);
      }
      joints.push_back(std::move(joint));
    }
  }
  return joints;
}

std::optional<Segmentation::Joined> Segmentation::Join(const Joint& joint) {
  Joined joined = {joint.chart, joint.other, GluedBorder(), {}, {}};
  joined.border =
      GlueBorder(joint.border.front(), static_cast<std::int32_t>(joint.border.size()), tuning_.widest, &gluing_);
  if (!joined.border.is_glued) return std::nullopt;
  joined.faces = std::move(faces_[joint.chart]);
  joined.other_faces = std::exchange(faces_[joint.other], {});
  std::vector<std::int32_t>& all = faces_[joint.chart] = {};
  std::merge(joined.faces.begin(), joined.faces.end(), joined.other_faces.begin(), joined.other_faces.end(),
             std::back_inserter(all));
  for (const std::int32_t f : joined.other_faces) chart_[f] = joint.chart;
  return joined;
}

void Segmentation::UndoJoin(const Joined& joined) {
  joined.border.Undo(&gluing_);
  faces_[joined.chart] = joined.faces;
  faces_[joined.other] = joined.other_faces;
  for (const std::int32_t f : joined.other_faces) chart_[f] = joined.other;
}

std::vector<std::int32_t> Segmentation::DropEmpty() {
  std::vector<std::int32_t> number(faces_.size(), -1);
  std::int32_t count = 0;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    if (!faces_[i].empty()) number[i] = count++;
  }
  for (std::int32_t& i : chart_) i = i < 0 ? i : number[i];
  CollectFaces();
  return number;
}

}  // namespace planish
