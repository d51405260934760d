#include "core/unwrap/reordering.h"

#include <algorithm>
#include <utility>

#include "core/base/radix_sort.h"
#include "core/mesh/spatial_order.h"

namespace planish {
namespace {

std::vector<std::int32_t> InverseOf(const std::vector<std::int32_t>& order) {
  std::vector<std::int32_t> inverse(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) inverse[order[i]] = static_cast<std::int32_t>(i);
  return inverse;
}

// values[order[i]] for every i; empty if `values` is.
template <typename Value>
std::vector<Value> InOrder(const std::vector<Value>& values, const std::vector<std::int32_t>& order) {
  std::vector<Value> ordered;
  if (values.empty()) return ordered;
  ordered.reserve(order.size());
  for (const std::int32_t i : order) ordered.push_back(values[i]);
  return ordered;
}

void MapFaces(const std::vector<std::int32_t>& to, std::vector<std::int32_t>* faces) {
  for (std::int32_t& f : *faces) f = to[f];
  std::sort(faces->begin(), faces->end());
}

void MapCorners(const std::vector<std::int32_t>& to, std::vector<std::int32_t>* corners) {
  for (std::int32_t& c : *corners) c = 3 * to[c / 3] + c % 3;
}

bool WillBeRefused(const Mesh& mesh) {
  return std::any_of(mesh.positions.begin(), mesh.positions.end(), [](const Vec3& p) { return !p.allFinite(); }) ||
         !std::all_of(mesh.faces.begin(), mesh.faces.end(), [&](const Face& face) { return mesh.IsInRange(face); });
}

}  // namespace

std::optional<Reordering> Reordering::Of(const Mesh& mesh, const Execution& execution) {
  if (WillBeRefused(mesh)) return std::nullopt;
  Reordering reordering;
  reordering.vertex_ = InSpatialOrder(mesh.positions, Indices(mesh.positions.size()), execution);
  if (execution.IsCancelled()) return std::nullopt;
  reordering.new_vertex_ = InverseOf(reordering.vertex_);
  reordering.face_ = FacesByFirstVertex(mesh.faces, reordering.new_vertex_);
  reordering.new_face_ = InverseOf(reordering.face_);
  return reordering;
}

Mesh Reordering::Apply(const Mesh& mesh) const {
  Mesh ordered = {InOrder(mesh.positions, vertex_), InOrder(mesh.faces, face_)};
  for (Face& face : ordered.faces) {
    for (std::int32_t& v : face) v = new_vertex_[v];
  }
  return ordered;
}

UnwrapOptions Reordering::Apply(const UnwrapOptions& options) const {
  UnwrapOptions ordered = options;
  MapCorners(new_face_, &ordered.seams.corners);
  MapCorners(new_face_, &ordered.seams.uncut_corners);
  ordered.face_polygon = InOrder(options.face_polygon, face_);
  ordered.face_atlas = InOrder(options.face_atlas, face_);
  ordered.face_weights = InOrder(options.face_weights, face_);
  return ordered;
}

void Reordering::Restore(UnwrapResult* result) const {
  std::vector<double> uv(result->uv.size());
  for (std::size_t i = 0; i < face_.size(); ++i) {
    std::copy_n(result->uv.begin() + static_cast<std::ptrdiff_t>(6 * i), 6, uv.begin() + 6 * std::ptrdiff_t{face_[i]});
  }
  result->uv = std::move(uv);
  result->face_chart = InOrder(result->face_chart, new_face_);
  MapFaces(face_, &result->widened);
  for (UnwrapWarning& warning : result->warnings) MapFaces(face_, &warning.faces);
}

}  // namespace planish
