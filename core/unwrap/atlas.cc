#include "core/unwrap/atlas.h"

#include <array>
#include <limits>
#include <vector>

#include "core/unwrap/placement.h"

namespace planish {
namespace {

// Moves the maps to where they go.
Atlas Place(const UnwrapOptions& options, const Execution& execution, ChartSet* charts) {
  Atlas atlas;
  if (!options.pack) {
    for (int i = 0; i < charts->count(); ++i) {
      Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity());
      for (const Vec2& p : charts->map(i).positions) low = low.cwiseMin(p);
      for (Vec2& p : *charts->positions(i)) p -= low;
    }
    return atlas;
  }
  if (options.seams.policy == SeamPolicy::kNone) {
    atlas.scale = PlaceInUnitSquare(charts->positions(0), execution);
    return atlas;
  }
  std::vector<PackChart> to_pack(charts->count());
  for (int i = 0; i < charts->count(); ++i) {
    to_pack[i].positions = charts->map(i).positions;
    to_pack[i].faces = charts->chart(i).topology.faces;
  }
  const Packing packing = Pack(to_pack, options.atlas, execution);
  atlas.tiles = packing.tiles;
  atlas.scale = packing.scale;
  atlas.padding = packing.padding;
  for (int i = 0; i < charts->count(); ++i) {
    for (Vec2& p : *charts->positions(i)) p = packing.charts[i](p);
  }
  return atlas;
}

// The UV of the two ends of an edge between two vertices, or of one corner at a vertex, wherever a face has UV there.
class ElsewhereUv {
 public:
  ElsewhereUv(const Mesh& mesh, const std::vector<std::int32_t>& face_chart, const CornerUv& uv)
      : mesh_(mesh), uv_(uv) {
    corners_.resize(mesh.positions.size());
    std::vector<char> wanted(mesh.positions.size(), 0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (face_chart[f] >= 0) continue;
      for (const std::int32_t v : mesh.faces[f]) wanted[v] = 1;
    }
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (face_chart[f] < 0) continue;
      for (int k = 0; k < 3; ++k) {
        if (wanted[mesh.faces[f][k]]) corners_[mesh.faces[f][k]].push_back(static_cast<std::int32_t>(3 * f) + k);
      }
    }
  }

  // Of each corner of a face without a chart.
  std::array<Vec2, 3> Of(const Face& face) const {
    // From a face that has both of its vertices, if there is one.
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = face[k], w = face[Next(k)];
      if (v == w) continue;
      for (const std::int32_t c : corners_[v]) {
        for (int j = 0; j < 3; ++j) {
          const std::int32_t d = 3 * (c / 3) + j;
          if (mesh_.faces[c / 3][j] != w) continue;
          std::array<Vec2, 3> places;
          for (int i = 0; i < 3; ++i) places[i] = At(face[i] == v ? c : d);
          return places;
        }
      }
    }
    for (const std::int32_t v : face) {
      if (!corners_[v].empty()) return {At(corners_[v].front()), At(corners_[v].front()), At(corners_[v].front())};
    }
    return {Vec2::Zero(), Vec2::Zero(), Vec2::Zero()};
  }

 private:
  Vec2 At(std::int32_t corner) const { return {uv_[2 * corner], uv_[2 * corner + 1]}; }

  const Mesh& mesh_;
  const CornerUv& uv_;
  std::vector<std::vector<std::int32_t>> corners_;  // with UV, per vertex of faces without
};

}  // namespace

Atlas MakeAtlas(const Mesh& mesh, const UnwrapOptions& options, const Execution& execution, ChartSet* charts) {
  Atlas atlas = Place(options, execution, charts);
  if (execution.IsStopped()) return atlas;
  atlas.uv.assign(6 * mesh.faces.size(), 0.0);
  for (int i = 0; i < charts->count(); ++i) {
    const Chart& chart = charts->chart(i);
    const std::vector<Vec2>& positions = charts->map(i).positions;
    execution.For(chart.topology.num_faces(), [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t f = begin; f < end; ++f) {
        for (int k = 0; k < 3; ++k) {
          const Vec2& p = positions[chart.topology.faces[f][k]];
          const std::size_t corner = 3 * static_cast<std::size_t>(chart.faces[f]) + k;
          atlas.uv[2 * corner] = p.x();
          atlas.uv[2 * corner + 1] = p.y();
        }
      }
    });
  }
  if (charts->ignored().empty()) return atlas;
  const std::vector<std::int32_t> face_chart = charts->FaceChart();
  const ElsewhereUv elsewhere(mesh, face_chart, atlas.uv);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (face_chart[f] >= 0) continue;
    const std::array<Vec2, 3> places = elsewhere.Of(mesh.faces[f]);
    for (std::size_t k = 0; k < 3; ++k) {
      atlas.uv[2 * (3 * f + k)] = places[k].x();
      atlas.uv[2 * (3 * f + k) + 1] = places[k].y();
    }
  }
  return atlas;
}

}  // namespace planish
