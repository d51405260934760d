#include "core/mesh/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <tuple>
#include <utility>

#include "Eigen/Geometry"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

constexpr double kNeedleDegrees = 1;

void Add(std::int64_t id, ElementList* list) {
  if (++list->count <= static_cast<std::int64_t>(kMaxDiagnosed)) list->first.push_back(id);
}

// Disjoint sets; the representative is the smallest member.
class Sets {
 public:
  explicit Sets(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }

  std::int32_t Find(std::int32_t x) {
    while (parent_[x] != x) x = parent_[x] = parent_[parent_[x]];
    return x;
  }
  void Join(std::int32_t a, std::int32_t b) {
    std::tie(a, b) = std::pair(Find(a), Find(b));
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::int32_t> parent_;
};

enum class FaceKind : char { kWithArea, kOutOfRange, kRepeatingAVertex, kNotFinite, kWithoutArea };

// The corners at the two ends of the half-edge that corner c faces.
std::int32_t OriginCorner(std::int32_t c) {
  return c - c % 3 + Next(c % 3);
}
std::int32_t TargetCorner(std::int32_t c) {
  return c - c % 3 + Prev(c % 3);
}

// One run of Diagnose().
class Examination {
 public:
  Examination(const Mesh& mesh, const Execution& execution) : mesh_(mesh), execution_(execution) {}

  absl::StatusOr<Diagnosis> operator()() {
    result_.vertices = mesh_.num_vertices();
    result_.faces = mesh_.num_faces();
    using Step = void (Examination::*)();
    for (const Step step :
         {&Examination::ClassifyFaces, &Examination::FindDuplicates, &Examination::LookAtVertices,
          &Examination::LookAtEdges, &Examination::LookAtFans, &Examination::LookAtComponents, &Examination::Measure}) {
      (this->*step)();
      if (execution_.IsStopped()) return absl::CancelledError("cancelled");
    }
    return std::move(result_);
  }

 private:
  void ClassifyFaces();
  void FindDuplicates();
  void LookAtVertices();
  void LookAtEdges();
  void LookAtFans();
  void LookAtComponents();
  void Measure();

  FaceKind KindOf(const Face& face) const;
  void NameEdge(std::int32_t edge, EdgeList* list) const;
  // Edge `e` has two faces; whether they are wound the same way.
  bool Agrees(std::int32_t e) const;
  std::int32_t NumFaces(std::int32_t e) const { return edges_.begin[e + 1] - edges_.begin[e]; }
  std::int32_t HalfEdge(std::int32_t e, std::int32_t i) const { return edges_.half_edge[edges_.begin[e] + i]; }

  const Mesh& mesh_;
  const Execution& execution_;
  Diagnosis result_;
  std::vector<FaceKind> kind_;
  std::vector<char> is_copy_;  // per face: the same vertices as an earlier one
  std::vector<char> used_;     // per vertex: has a face in range
  // The surface, its faces and corners numbered anew.
  std::vector<Face> surface_;
  std::vector<std::int32_t> source_face_;
  EdgeGroups edges_;
  std::vector<std::int32_t> fan_;  // per corner: the first corner of its fan
};

FaceKind Examination::KindOf(const Face& face) const {
  const auto& [a, b, c] = face;
  for (const std::int32_t v : face) {
    if (v < 0 || v >= mesh_.num_vertices()) return FaceKind::kOutOfRange;
  }
  if (a == b || b == c || c == a) return FaceKind::kRepeatingAVertex;
  for (const std::int32_t v : face) {
    if (!mesh_.positions[v].allFinite()) return FaceKind::kNotFinite;
  }
  return IsDegenerateTriangle(mesh_.positions[a], mesh_.positions[b], mesh_.positions[c]) ? FaceKind::kWithoutArea
                                                                                          : FaceKind::kWithArea;
}

void Examination::ClassifyFaces() {
  kind_.resize(mesh_.faces.size());
  execution_.For(mesh_.num_faces(), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t f = begin; f < end; ++f) kind_[f] = KindOf(mesh_.faces[f]);
  });
  for (std::int64_t f = 0; f < mesh_.num_faces(); ++f) {
    switch (kind_[f]) {
      case FaceKind::kWithArea:
        break;
      case FaceKind::kOutOfRange:
        Add(f, &result_.faces_out_of_range);
        break;
      case FaceKind::kRepeatingAVertex:
        Add(f, &result_.faces_repeating_a_vertex);
        break;
      case FaceKind::kNotFinite:
        Add(f, &result_.faces_not_finite);
        break;
      case FaceKind::kWithoutArea:
        Add(f, &result_.faces_without_area);
        break;
    }
  }
}

// One short list of faces per smallest vertex, sorted by the other two.
void Examination::FindDuplicates() {
  is_copy_.assign(mesh_.faces.size(), 0);
  const auto in_range = [&](std::int64_t f) { return kind_[f] != FaceKind::kOutOfRange; };
  const auto smallest = [&](std::int64_t f) { return *std::min_element(mesh_.faces[f].begin(), mesh_.faces[f].end()); };
  std::vector<std::int32_t> bucket(mesh_.positions.size() + 1, 0);
  for (std::int64_t f = 0; f < mesh_.num_faces(); ++f) {
    if (in_range(f)) ++bucket[smallest(f) + 1];
  }
  std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());
  struct Entry {
    Face sorted;
    std::int32_t face;
  };
  std::vector<Entry> entries(static_cast<std::size_t>(bucket.back()));
  std::vector<std::int32_t> cursor(bucket.begin(), bucket.end() - 1);
  for (std::int64_t f = 0; f < mesh_.num_faces(); ++f) {
    if (!in_range(f)) continue;
    Entry& entry = entries[cursor[smallest(f)]++];
    entry = {mesh_.faces[f], static_cast<std::int32_t>(f)};
    std::sort(entry.sorted.begin(), entry.sorted.end());
  }
  execution_.For(mesh_.num_vertices(), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t v = begin; v < end; ++v) {
      const auto first = entries.begin() + bucket[v], last = entries.begin() + bucket[v + 1];
      std::sort(first, last,
                [](const Entry& a, const Entry& b) { return std::tie(a.sorted, a.face) < std::tie(b.sorted, b.face); });
      for (auto it = first; it != last; ++it) {
        if (it != first && it->sorted == std::prev(it)->sorted) is_copy_[it->face] = 1;
      }
    }
  });
  for (std::int64_t f = 0; f < mesh_.num_faces(); ++f) {
    if (is_copy_[f]) Add(f, &result_.duplicate_faces);
  }
}

void Examination::LookAtVertices() {
  used_.assign(mesh_.positions.size(), 0);
  for (std::int64_t f = 0; f < mesh_.num_faces(); ++f) {
    if (kind_[f] == FaceKind::kOutOfRange) continue;
    for (const std::int32_t v : mesh_.faces[f]) used_[v] = 1;
  }
  std::vector<std::int32_t> finite;
  for (std::int64_t v = 0; v < mesh_.num_vertices(); ++v) {
    if (!used_[v]) Add(v, &result_.isolated_vertices);
    const bool is_finite = mesh_.positions[v].allFinite();
    if (is_finite) finite.push_back(static_cast<std::int32_t>(v));
    if (used_[v] && !is_finite) Add(v, &result_.vertices_not_finite);
  }
  const auto coordinates = [&](std::int32_t v) {
    const Vec3& p = mesh_.positions[v];
    return std::tuple(p.x(), p.y(), p.z());
  };
  std::sort(finite.begin(), finite.end(), [&](std::int32_t a, std::int32_t b) {
    return std::pair(coordinates(a), a) < std::pair(coordinates(b), b);
  });
  std::vector<std::int32_t> coincident;
  for (std::size_t i = 1; i < finite.size(); ++i) {
    if (coordinates(finite[i]) == coordinates(finite[i - 1])) coincident.push_back(finite[i]);
  }
  std::sort(coincident.begin(), coincident.end());
  for (const std::int32_t v : coincident) Add(v, &result_.coincident_vertices);
}

bool Examination::Agrees(std::int32_t e) const {
  return Origin(surface_, HalfEdge(e, 0)) == Target(surface_, HalfEdge(e, 1));
}

void Examination::NameEdge(std::int32_t edge, EdgeList* list) const {
  if (++list->count > static_cast<std::int64_t>(kMaxDiagnosed)) return;
  const std::int32_t c = HalfEdge(edge, 0);
  const auto [low, high] = std::minmax({Origin(surface_, c), Target(surface_, c)});
  list->first.push_back({low, high});
  for (std::int32_t i = 0; i < NumFaces(edge) && list->faces.size() < kMaxDiagnosed; ++i) {
    list->faces.push_back(source_face_[HalfEdge(edge, i) / 3]);
  }
}

void Examination::LookAtEdges() {
  for (std::int64_t f = 0; f < mesh_.num_faces(); ++f) {
    if (is_copy_[f] || (kind_[f] != FaceKind::kWithArea && kind_[f] != FaceKind::kNotFinite)) continue;
    surface_.push_back(mesh_.faces[f]);
    source_face_.push_back(static_cast<std::int32_t>(f));
  }
  result_.surface_faces = static_cast<std::int64_t>(surface_.size());
  edges_ = GroupHalfEdges(surface_, mesh_.num_vertices(), execution_);
  result_.edges = edges_.num_edges();
  for (std::int32_t e = 0; e < edges_.num_edges(); ++e) {
    if (NumFaces(e) == 1) ++result_.boundary_edges;
    if (NumFaces(e) == 2 && !Agrees(e)) NameEdge(e, &result_.inconsistent_edges);
    if (NumFaces(e) > 2) NameEdge(e, &result_.non_manifold_edges);
  }
}

void Examination::LookAtFans() {
  Sets fans(3 * surface_.size());
  for (std::int32_t e = 0; e < edges_.num_edges() && !execution_.IsStoppedAt(e); ++e) {
    if (NumFaces(e) != 2) continue;
    const std::int32_t c = HalfEdge(e, 0), d = HalfEdge(e, 1);
    fans.Join(OriginCorner(c), Agrees(e) ? TargetCorner(d) : OriginCorner(d));
    fans.Join(TargetCorner(c), Agrees(e) ? OriginCorner(d) : TargetCorner(d));
  }
  fan_.resize(3 * surface_.size());
  std::vector<std::int32_t> num_fans(mesh_.positions.size(), 0);
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(fan_.size()); ++c) {
    fan_[c] = fans.Find(c);
    if (fan_[c] == c) ++num_fans[surface_[c / 3][c % 3]];
  }
  for (std::int64_t v = 0; v < mesh_.num_vertices(); ++v) {
    if (num_fans[v] > 1) Add(v, &result_.non_manifold_vertices);
  }
}

void Examination::LookAtComponents() {
  const auto num_faces = static_cast<std::int32_t>(surface_.size());
  // Faces come twice in `sides`, as they are and turned over: over every edge the sides that agree are joined. Where a
  // face is in one set with its own other side, the component is not orientable.
  Sets pieces(surface_.size()), agreeing(surface_.size()), sides(2 * surface_.size()), loops(fan_.size());
  for (std::int32_t e = 0; e < edges_.num_edges() && !execution_.IsStoppedAt(e); ++e) {
    if (NumFaces(e) != 2) {
      for (std::int32_t i = 0; i < NumFaces(e); ++i) {
        loops.Join(fan_[OriginCorner(HalfEdge(e, i))], fan_[TargetCorner(HalfEdge(e, i))]);
      }
      continue;
    }
    const std::int32_t f = HalfEdge(e, 0) / 3, g = HalfEdge(e, 1) / 3;
    const bool agrees = Agrees(e);
    pieces.Join(f, g);
    if (agrees) agreeing.Join(f, g);
    sides.Join(2 * f, agrees ? 2 * g : 2 * g + 1);
    sides.Join(2 * f + 1, agrees ? 2 * g + 1 : 2 * g);
  }
  if (execution_.IsStopped()) return;

  std::vector<std::int32_t> number(surface_.size());
  for (std::int32_t f = 0; f < num_faces; ++f) {
    if (agreeing.Find(f) == f) ++result_.oriented_pieces;
    const std::int32_t first = pieces.Find(f);  // the smallest: seen before
    if (first == f) {
      number[f] = static_cast<std::int32_t>(result_.components.size());
      Component& component = result_.components.emplace_back();
      component.first_face = source_face_[f];
      component.orientable = sides.Find(2 * f) != sides.Find(2 * f + 1);
    }
    number[f] = number[first];
    Component& component = result_.components[number[f]];
    ++component.faces;
    ++component.euler_characteristic;
  }
  const auto component_of = [&](std::int32_t c) -> Component& { return result_.components[number[c / 3]]; };
  std::vector<char> on_loop(fan_.size(), 0);
  for (std::int32_t e = 0; e < edges_.num_edges(); ++e) {
    if (NumFaces(e) == 2) {
      --component_of(HalfEdge(e, 0)).euler_characteristic;
      continue;
    }
    for (std::int32_t i = 0; i < NumFaces(e); ++i) {
      const std::int32_t c = HalfEdge(e, i);
      --component_of(c).euler_characteristic;
      ++component_of(c).boundary_edges;
      on_loop[loops.Find(fan_[OriginCorner(c)])] = 1;
    }
  }
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(fan_.size()); ++c) {
    if (fan_[c] == c) ++component_of(c).euler_characteristic;
    if (on_loop[c]) ++component_of(c).boundary_loops;
  }
  for (Component& component : result_.components) {
    const std::int64_t missing = 2 - component.boundary_loops - component.euler_characteristic;
    (component.orientable ? component.handles : component.crosscaps) = component.orientable ? missing / 2 : missing;
  }
}

void Examination::Measure() {
  bool any = false;
  for (std::int64_t v = 0; v < mesh_.num_vertices(); ++v) {
    const Vec3& p = mesh_.positions[v];
    if (!used_[v] || !p.allFinite()) continue;
    result_.box_min = any ? result_.box_min.cwiseMin(p).eval() : p;
    result_.box_max = any ? result_.box_max.cwiseMax(p).eval() : p;
    any = true;
  }
  // Of the finite faces of the surface.
  Mesh finite;
  std::vector<std::int64_t> source;
  finite.positions = mesh_.positions;
  for (std::size_t f = 0; f < surface_.size(); ++f) {
    if (kind_[source_face_[f]] != FaceKind::kWithArea) continue;
    finite.faces.push_back(surface_[f]);
    source.push_back(source_face_[f]);
  }
  if (finite.faces.empty()) return;
  const Eigen::VectorXd angles = MeasuredAngles(finite, execution_) * (180 / std::numbers::pi);
  if (execution_.IsStopped()) return;
  result_.angle_min_degrees = angles.minCoeff();
  result_.angle_max_degrees = angles.maxCoeff();
  for (std::int64_t f = 0; f < finite.num_faces(); ++f) {
    const auto& [a, b, c] = finite.faces[f];
    const Vec3& p = finite.positions[a];
    result_.area += (finite.positions[b] - p).cross(finite.positions[c] - p).norm() / 2;
    if (angles.segment<3>(3 * f).minCoeff() < kNeedleDegrees) Add(source[f], &result_.needles);
  }
}

// "face 4", "faces 4, 7, 9, 12 and 80 more".
std::string Elements(const std::string& one, const std::string& many, const ElementList& list) {
  constexpr std::size_t kMaxInMessage = 4;
  const std::size_t named = std::min(kMaxInMessage, list.first.size());
  std::string text =
      absl::StrCat(list.count == 1 ? one : many, " ",
                   absl::StrJoin(list.first.begin(), list.first.begin() + static_cast<std::ptrdiff_t>(named), ", "));
  const std::int64_t more = list.count - static_cast<std::int64_t>(named);
  if (more > 0) absl::StrAppend(&text, " and ", more, " more");
  return text;
}

absl::Status Refuse(const std::string& reason, const std::string& message, std::int64_t count,
                    std::map<std::string, std::string> metadata) {
  metadata["count"] = absl::StrCat(count);
  return MakeError(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

}  // namespace

std::int64_t Diagnosis::boundary_loops() const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.boundary_loops;
  return sum;
}

std::int64_t Diagnosis::euler_characteristic() const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.euler_characteristic;
  return sum;
}

std::int64_t Diagnosis::handles() const {
  std::int64_t sum = 0;
  for (const Component& component : components) sum += component.handles;
  return sum;
}

bool Diagnosis::is_orientable() const {
  return std::all_of(components.begin(), components.end(), [](const Component& c) { return c.orientable; });
}

bool Diagnosis::is_disc() const {
  return surface_faces == faces && faces_not_finite.count == 0 && non_manifold_edges.count == 0 &&
         inconsistent_edges.count == 0 && non_manifold_vertices.count == 0 && components.size() == 1 &&
         components[0].IsDisc();
}

absl::Status Diagnosis::Refusal() const {
  if (faces == 0) return Refuse("MESH_EMPTY", "the mesh has no faces; there is nothing to flatten", 0, {});
  if (faces_out_of_range.count > 0) {
    return Refuse("MESH_INDEX_OUT_OF_RANGE",
                  absl::StrCat(Elements("face", "faces", faces_out_of_range),
                               faces_out_of_range.count == 1 ? " refers" : " refer",
                               " to vertices that do not exist (the mesh has ", vertices, ")"),
                  faces_out_of_range.count, {{"faces", absl::StrJoin(faces_out_of_range.first, ",")}});
  }
  if (vertices_not_finite.count > 0) {
    return Refuse("MESH_POSITION_NOT_FINITE",
                  absl::StrCat("the position of ", Elements("vertex", "vertices", vertices_not_finite),
                               " is NaN or infinite; give every vertex finite coordinates"),
                  vertices_not_finite.count, {{"vertices", absl::StrJoin(vertices_not_finite.first, ",")}});
  }
  if (surface_faces == 0) {
    return Refuse("MESH_FACE_DEGENERATE", "no face of the mesh has any area, so there are no angles to keep", faces,
                  {});
  }
  return absl::OkStatus();
}

absl::StatusOr<Diagnosis> Diagnose(const Mesh& mesh, const Execution& execution) {
  constexpr std::int64_t kMax = std::numeric_limits<std::int32_t>::max();
  if (mesh.num_faces() > kMax / 3 || mesh.num_vertices() > kMax) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_TOO_LARGE",
                     "the mesh has more than 2^31 vertices or corners");
  }
  return Examination(mesh, execution)();
}

}  // namespace planish
