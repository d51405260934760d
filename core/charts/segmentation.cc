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

using Nearness = Segmentation::Nearness;
constexpr Nearness kFar(std::numeric_limits<double>::infinity(), -1);

enum class Measure { kLength, kEdges };

// Per face of a chart: its distance from the nearest of `sources`, and the index of that source, the lowest if several
// are equally near. Distances go from face centre to face centre without crossing slits of the chart; they are lengths,
// or numbers of crossed edges. Crossing an uncut edge costs nothing. `at`, per face of the surface, is kFar before and
// after.
std::vector<Nearness> DistancesFrom(const std::vector<std::int32_t>& sources, Measure measure,
                                    const std::vector<std::int32_t>& faces, const Gluing& gluing,
                                    std::vector<Nearness>* at) {
  using Entry = std::pair<Nearness, std::int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  const auto reach = [&](const Nearness& there, std::int32_t f) {
    if (!(there < (*at)[f])) return;
    (*at)[f] = there;
    queue.emplace(there, f);
  };
  for (std::size_t i = 0; i < sources.size(); ++i) reach({0.0, static_cast<std::int32_t>(i)}, sources[i]);
  const TriMesh& mesh = gluing.mesh();
  while (!queue.empty()) {
    const auto [nearness, f] = queue.top();
    queue.pop();
    if ((*at)[f] < nearness) continue;
    const Vec3 centre = Centre(mesh, f);
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) {
      if (gluing.IsOutline(h)) continue;
      const std::int32_t g = gluing.surface().face_across(h);
      if (!(nearness < (*at)[g])) continue;  // no length can make g nearer
      const double length = measure == Measure::kEdges ? 1 : (centre - Centre(mesh, g)).norm();
      reach({nearness.first + (gluing.surface().is_uncut(h) ? 0 : length), nearness.second}, g);
    }
  }
  std::vector<Nearness> found;
  found.reserve(faces.size());
  for (const std::int32_t f : faces) found.push_back(std::exchange((*at)[f], kFar));
  return found;
}

// Cuts a chart in two: per face, 0 if it is nearer to `face` and 1 if it is nearer to `other_face`. If these are
// -1, or in one polygon, two faces that are about as far apart as possible take their place. All 0 if the chart is
// one polygon.
std::vector<std::int32_t> Halve(const std::vector<std::int32_t>& faces, std::int32_t face, std::int32_t other_face,
                                const Gluing& gluing, std::vector<Nearness>* at) {
  // The smaller half should have at least 1 / kLeastShare of the faces. Where triangles are of very different sizes,
  // one may be as long as all others together, and a cut by length would take off a single face in each round. Such
  // charts are cut by the number of edges between faces.
  constexpr std::ptrdiff_t kLeastShare = 16;
  std::vector<std::int32_t> half(faces.size());
  std::ptrdiff_t count = 0;
  const auto part = [&](std::int32_t first, std::int32_t second, Measure measure) {
    const std::vector<Nearness> nearness = DistancesFrom({first, second}, measure, faces, gluing, at);
    for (std::size_t i = 0; i < faces.size(); ++i) half[i] = nearness[i].second == 1 ? 1 : 0;
    count = std::count(half.begin(), half.end(), 1);
    return count > 0;
  };
  if (face >= 0 && part(face, other_face, Measure::kLength)) return half;
  // The face farthest from f, the lowest of several.
  const auto farthest_from = [&](std::int32_t f, Measure measure) {
    const std::vector<Nearness> nearness = DistancesFrom({f}, measure, faces, gluing, at);
    const auto is_nearer = [](const Nearness& a, const Nearness& b) { return a.first < b.first; };
    return faces[std::max_element(nearness.begin(), nearness.end(), is_nearer) - nearness.begin()];
  };
  for (const Measure measure : {Measure::kLength, Measure::kEdges}) {
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
    // Fractions of the time at the end of each step, measured on nets, scans and models of 20,000 to 450,000 faces.
    constexpr double kPatches = 0.15, kMerged = 0.95;
    chart_ = MakePatches(surface, tuning, execution);
    execution.Report(kPatches);
    if (execution.IsCancelled()) return;
    const std::int32_t count = chart_.empty() ? 0 : *std::max_element(chart_.begin(), chart_.end()) + 1;
    GluePieces(chart_, &gluing_);
    MergeDiscs(count, max_stretch, tuning, execution.Part(kPatches, kMerged), &gluing_, &chart_, &kept_);
    SmoothOutlines(tuning_, execution, Indices(chart_.size()), &gluing_, &chart_);
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
  SmoothOutlines(tuning_, execution, Indices(chart_.size()), &gluing_, &chart_);
  CollectFaces();
}

Segmentation Segmentation::Mirrored(const Surface& surface, const Segmentation& half, const Mirror& mirror) {
  Segmentation whole(surface, half.tuning_);
  const TriMesh &mesh = *surface.mesh, &half_mesh = *half.surface_.mesh;
  whole.kept_.assign(mesh.n_vertices(), 0.0F);
  const auto count = static_cast<std::int32_t>(half.faces_.size());
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (!surface.takes_part[f]) continue;
    const bool is_second = mirror.side[f] == Mirror::Side::kSecond;
    const std::int32_t like = is_second ? mirror.face[f] : f;
    whole.chart_[f] = like < 0 || half.chart_[like] < 0 ? 2 * count : half.chart_[like] + (is_second ? count : 0);
  }
  const auto glue = [&](std::int32_t c, std::int32_t across) {
    if (c < 0 || across < 0 || whole.chart_[c / 3] != whole.chart_[across / 3] || whole.chart_[c / 3] < 0) return;
    if (CornerAcross(mesh, c) == across) whole.gluing_.Glue(HalfEdgeOf(mesh, c));
  };
  for (std::int32_t c = 0; c < 3 * surface.num_faces(); ++c) {
    if (mirror.side[c / 3] == Mirror::Side::kSecond) {
      const std::int32_t across = CornerAcross(mesh, c);
      if (across >= 0 && mirror.polygon[across / 3] == mirror.polygon[c / 3]) glue(c, across);
      continue;
    }
    if (half.chart_[c / 3] < 0) continue;
    const HalfedgeHandle h = HalfEdgeOf(half_mesh, c);
    const float kept = half.kept_[half_mesh.to_vertex_handle(h).idx()];
    whole.kept_[mesh.to_vertex_handle(HalfEdgeOf(mesh, c)).idx()] = kept;
    const std::int32_t image = mirror.corner[c];
    if (image >= 0) whole.kept_[mesh.from_vertex_handle(HalfEdgeOf(mesh, image)).idx()] = kept;
    if (half.gluing_.IsOutline(h)) continue;
    const std::int32_t across = CornerAcross(half_mesh, c);
    glue(c, across);
    if (mirror.side[c / 3] == Mirror::Side::kFirst) glue(image, mirror.corner[across]);
  }
  whole.faces_.resize(2 * count + 1);
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (whole.chart_[f] >= 0) whole.faces_[whole.chart_[f]].push_back(f);
  }
  whole.MakeDiscs();
  return whole;
}

// Repairs charts that are not discs: each connected piece becomes a disc, and the largest keeps the number.
void Segmentation::MakeDiscs() {
  PrepareScratch();
  const TriMesh& mesh = *surface_.mesh;
  const auto connected = [&](std::int32_t start, const auto& leads_on) {
    std::vector<std::int32_t> faces = {start};
    scratch_.is_glued[start] = 1;
    for (std::size_t i = 0; i < faces.size(); ++i) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(faces[i]))) {
        const std::int32_t g = surface_.face_across(h);
        if (g < 0 || chart_[g] != chart_[start] || scratch_.is_glued[g] != 0 || !leads_on(h)) continue;
        scratch_.is_glued[g] = 1;
        faces.push_back(g);
      }
    }
    return faces;
  };
  const auto forget = [&](const std::vector<std::int32_t>& faces) {
    for (const std::int32_t f : faces) scratch_.is_glued[f] = 0;
  };
  const auto count = static_cast<std::int32_t>(faces_.size());
  for (std::int32_t i = 0; i < count; ++i) {
    const std::vector<std::int32_t> faces = faces_[i];
    if (faces.empty()) continue;
    const std::vector<std::int32_t> first =
        connected(faces.front(), [&](HalfedgeHandle h) { return !gluing_.IsOutline(h); });
    forget(first);
    if (first.size() == faces.size() && IsDisc(faces, &scratch_.is_seen)) continue;
    for (const std::int32_t f : faces) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) gluing_.Unglue(h);
    }
    std::vector<std::vector<std::int32_t>> pieces;
    std::size_t largest = 0;
    for (const std::int32_t f : faces) {
      if (scratch_.is_glued[f] != 0) continue;
      pieces.push_back(connected(f, [](HalfedgeHandle) { return true; }));
      if (pieces.back().size() > pieces[largest].size()) largest = pieces.size() - 1;
    }
    forget(faces);
    for (std::size_t k = 0; k < pieces.size(); ++k) {
      const auto number = k == largest ? i : static_cast<std::int32_t>(faces_.size());
      std::sort(pieces[k].begin(), pieces[k].end());
      for (const std::int32_t f : pieces[k]) chart_[f] = number;
      GluePiece(pieces[k].front(), chart_, &scratch_.is_glued, &gluing_);
      forget(pieces[k]);
      if (k != largest) faces_.emplace_back();
      faces_[number] = std::move(pieces[k]);
    }
  }
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
  for (const std::int32_t f : faces_[chart]) {
    for (const HalfedgeHandle h : HalfEdgesOf(*surface_.mesh, FaceHandle(f))) {
      const std::int32_t across = surface_.face_across(h);
      if (gluing_.IsOutline(h) && across >= 0 && chart_[across] == chart) return true;
    }
  }
  return false;
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

void Segmentation::PrepareScratch() {
  if (!scratch_.moving.empty()) return;
  scratch_.nearness.assign(chart_.size(), kFar);
  scratch_.moving.assign(chart_.size(), -1);
  scratch_.is_seen.assign(surface_.mesh->n_halfedges(), 0);
  scratch_.is_glued.assign(chart_.size(), 0);
}

std::vector<std::int32_t> Segmentation::Split(const std::vector<Cut>& cuts, const Execution& execution) {
  PrepareScratch();
  std::vector<std::int32_t> changed;
  for (const auto& [chart, face, other_face, given] : cuts) {
    if (faces_[chart].size() < 2 || execution.IsCancelled()) continue;
    const std::vector<std::int32_t> faces = faces_[chart];
    const std::vector<std::int32_t> part =
        given.empty() ? Halve(faces, face, other_face, gluing_, &scratch_.nearness) : given;
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
      // Not a disc, because the part runs round another one.
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

std::vector<HalfedgeHandle> Segmentation::Outline(std::int32_t chart) const {
  if (faces_[chart].empty()) return {};
  return OutlineFrom(gluing_, FirstOnOutline(gluing_, faces_[chart]));
}

std::vector<Segmentation::Joint> Segmentation::Joints(std::vector<std::vector<HalfedgeHandle>> outlines) const {
  std::vector<Joint> joints;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(faces_.size()); ++i) {
    if (faces_[i].empty()) continue;
    for (const auto& [border, other] : BordersAlong(gluing_, chart_, &outlines[i])) {
      if (other < i || outlines[i].size() + outlines[other].size() < 2 * border.size() + 3) continue;
      joints.push_back({i, other, {border.begin(), border.end()}});
    }
  }
  return joints;
}

std::optional<Segmentation::Joined> Segmentation::Join(const Joint& joint) {
  std::optional<GluedBorder> border =
      GlueBorder(joint.border.front(), static_cast<std::int32_t>(joint.border.size()), tuning_.Widest(),
                 /*zips=*/!joint.is_part, &gluing_);
  if (!border) return std::nullopt;
  Joined joined = {joint.chart, joint.other, *std::move(border), {}, {}};
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

// Moves the faces between the old border `from` and the new border `to` of two charts from one chart to the other;
// `chart` then lies on the left of `to`. A simple path between two places on the outline of a disc cuts it into two
// discs. Returns false, and changes nothing, if `to` is no such path. O(n), with little work for faces that keep their
// chart.
bool Segmentation::HandOver(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                            std::span<const HalfedgeHandle> to) {
  const TriMesh& mesh = *surface_.mesh;
  const auto left_of = [&](HalfedgeHandle h) { return mesh.face_handle(h).idx(); };
  // The faces of chart `was` that are reached from one side of `to` without crossing a seam. Assigns them to chart
  // `is`.
  const auto flood = [&](bool is_left, std::int32_t was, std::int32_t is) {
    std::vector<std::int32_t> faces;
    const auto reach = [&](std::int32_t f) {
      if (chart_[f] != was) return;
      chart_[f] = is;
      faces.push_back(f);
    };
    for (const HalfedgeHandle h : to) reach(is_left ? left_of(h) : surface_.face_across(h));
    for (std::size_t i = 0; i < faces.size(); ++i) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(faces[i]))) {
        if (!gluing_.IsOutline(h)) reach(surface_.face_across(h));
      }
    }
    std::sort(faces.begin(), faces.end());
    return faces;
  };
  const std::vector<std::int32_t> to_other = flood(false, chart, other), to_chart = flood(true, other, chart);
  bool is_good = to_other.size() < faces_[chart].size() + to_chart.size() &&
                 to_chart.size() < faces_[other].size() + to_other.size();
  for (const HalfedgeHandle h : to) {
    is_good = is_good && chart_[left_of(h)] == chart && chart_[surface_.face_across(h)] == other;
  }
  for (const HalfedgeHandle h : from) {
    is_good = is_good && (gluing_.IsOutline(h) || chart_[left_of(h)] == chart_[surface_.face_across(h)]);
  }
  if (!is_good) {
    for (const std::int32_t f : to_other) chart_[f] = chart;
    for (const std::int32_t f : to_chart) chart_[f] = other;
    return false;
  }
  std::vector<std::int32_t> rest, all;
  const auto exchange = [&](const std::vector<std::int32_t>& lost, const std::vector<std::int32_t>& won,
                            std::vector<std::int32_t>* faces) {
    rest.clear();
    all.clear();
    std::set_difference(faces->begin(), faces->end(), lost.begin(), lost.end(), std::back_inserter(rest));
    std::merge(rest.begin(), rest.end(), won.begin(), won.end(), std::back_inserter(all));
    std::swap(all, *faces);
  };
  exchange(to_other, to_chart, &faces_[chart]);
  exchange(to_chart, to_other, &faces_[other]);
  return true;
}

// Glues `from` and cuts `to`. The new discs get the numbers of the old ones of which they have most faces. Returns
// whether there are as many discs as before; if not, only the gluing has changed.
bool Segmentation::Recut(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                         std::span<const HalfedgeHandle> to) {
  for (const HalfedgeHandle h : from) gluing_.Glue(h);
  for (const HalfedgeHandle h : to) gluing_.Unglue(h);
  if (chart != other && HandOver(chart, other, from, to)) return true;
  const std::size_t parts = chart == other ? 1 : 2;
  std::vector<std::int32_t> all = faces_[chart];
  if (parts == 2) all.insert(all.end(), faces_[other].begin(), faces_[other].end());
  std::vector<std::int32_t>& part = scratch_.moving;  // all -1 before and after
  std::vector<std::vector<std::int32_t>> found;
  for (const std::int32_t start : all) {
    if (part[start] >= 0) continue;
    const auto number = static_cast<std::int32_t>(found.size());
    std::vector<std::int32_t>& faces = found.emplace_back();
    part[start] = number;
    faces.push_back(start);
    for (std::size_t i = 0; i < faces.size(); ++i) {
      for (const HalfedgeHandle h : HalfEdgesOf(*surface_.mesh, FaceHandle(faces[i]))) {
        if (gluing_.IsOutline(h) || part[surface_.face_across(h)] >= 0) continue;
        part[surface_.face_across(h)] = number;
        faces.push_back(surface_.face_across(h));
      }
    }
  }
  for (const std::int32_t f : all) part[f] = -1;
  if (found.size() != parts) return false;
  if (!std::all_of(found.begin(), found.end(),
                   [&](const std::vector<std::int32_t>& faces) { return IsDisc(faces, &scratch_.is_seen); })) {
    return false;
  }
  if (parts == 1) return true;
  const auto of_chart = [&](const std::vector<std::int32_t>& faces) {
    return std::count_if(faces.begin(), faces.end(), [&](std::int32_t f) { return chart_[f] == chart; });
  };
  // Compares shares, since both discs may have most of their faces from the same old one.
  if (of_chart(found[0]) * std::ssize(found[1]) < of_chart(found[1]) * std::ssize(found[0]))
    std::swap(found[0], found[1]);
  faces_[chart] = std::move(found[0]);
  faces_[other] = std::move(found[1]);
  for (const std::int32_t number : {chart, other}) {
    std::sort(faces_[number].begin(), faces_[number].end());
    for (const std::int32_t f : faces_[number]) chart_[f] = number;
  }
  return true;
}

bool Segmentation::MoveSeam(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                            std::span<const HalfedgeHandle> to) {
  PrepareScratch();
  const TriMesh& mesh = *surface_.mesh;
  const auto is_wide = [&](VertexHandle v) {
    for (const HalfedgeHandle h : mesh.vih_range(v)) {
      if (mesh.is_boundary(h) || !gluing_.IsOutline(h)) continue;
      const std::int32_t of = chart_[mesh.face_handle(h).idx()];
      if ((of == chart || of == other) && gluing_.IsTooWide(h, tuning_.Widest())) return true;
    }
    return false;
  };
  bool is_good = Recut(chart, other, from, to);
  if (is_good) {
    for (const std::span<const HalfedgeHandle> path : {from, to}) {
      if (is_wide(mesh.from_vertex_handle(path.front()))) is_good = false;
      for (const HalfedgeHandle h : path) is_good = is_good && !is_wide(mesh.to_vertex_handle(h));
    }
  }
  if (!is_good) Recut(chart, other, to, from);
  return is_good;
}

void Segmentation::UndoMoveSeam(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                                std::span<const HalfedgeHandle> to) {
  PrepareScratch();
  Recut(chart, other, to, from);
}

void Segmentation::DropEmpty() {
  std::erase_if(faces_, [](const std::vector<std::int32_t>& faces) { return faces.empty(); });
  for (std::int32_t i = 0; i < std::ssize(faces_); ++i) {
    for (const std::int32_t f : faces_[i]) chart_[f] = i;
  }
}

}  // namespace planish
