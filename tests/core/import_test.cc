// Any soup becomes a manifold mesh that has all of its faces.
#include "core/mesh/import.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <set>

#include "Eigen/Geometry"
#include "core/mesh/half_edges.h"
#include "core/mesh/tri_mesh.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TriMesh Imported(const Mesh& mesh) {
  return ImportMesh(mesh, PairHalfEdges(mesh, JoinFor::kCharts).opposite);
}

// Everything that half-edges promise each other, and that each vertex has one fan.
void ExpectManifold(const Mesh& soup, const TriMesh& mesh) {
  ASSERT_EQ(mesh.n_faces(), soup.faces.size());
  std::vector<int> corners(mesh.n_vertices(), 0);
  for (const FaceHandle f : mesh.faces()) {
    const std::array<VertexHandle, 3> vertices = VerticesOf(mesh, f);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(mesh.data(vertices[k]).source, soup.faces[f.idx()][k]);
      const HalfedgeHandle h = HalfEdgeOf(mesh, 3 * f.idx() + k);
      EXPECT_EQ(CornerOf(mesh, h), 3 * f.idx() + k);
      EXPECT_EQ(mesh.face_handle(h), f);
      EXPECT_EQ(mesh.from_vertex_handle(h), vertices[Next(k)]);
      EXPECT_EQ(mesh.to_vertex_handle(h), vertices[Prev(k)]);
      ++corners[vertices[k].idx()];
    }
  }
  for (const HalfedgeHandle h : mesh.halfedges()) {
    EXPECT_EQ(mesh.prev_halfedge_handle(mesh.next_halfedge_handle(h)), h);
    EXPECT_EQ(mesh.from_vertex_handle(mesh.next_halfedge_handle(h)), mesh.to_vertex_handle(h));
    EXPECT_EQ(mesh.face_handle(mesh.next_halfedge_handle(h)), mesh.face_handle(h));
  }
  for (const EdgeHandle e : mesh.edges()) EXPECT_FALSE(mesh.is_boundary(mesh.halfedge_handle(e, 0)));
  for (const VertexHandle v : mesh.vertices()) {
    int faces = 0, boundary = 0;
    for (const FaceHandle f : mesh.vf_range(v)) faces += f.is_valid();
    for (const HalfedgeHandle h : mesh.voh_range(v)) boundary += mesh.is_boundary(h);
    EXPECT_EQ(faces, corners[v.idx()]) << "one fan";
    EXPECT_LE(boundary, 1);
    EXPECT_EQ(mesh.is_boundary(v), boundary == 1);
  }
}

// Of each boundary loop: its edges, by the half-edges without a face.
std::vector<int> LoopLengths(const TriMesh& mesh) {
  std::vector<int> lengths;
  std::vector<char> seen(mesh.n_halfedges(), 0);
  for (const HalfedgeHandle start : mesh.halfedges()) {
    if (!mesh.is_boundary(start) || seen[start.idx()]) continue;
    lengths.push_back(0);
    for (HalfedgeHandle h = start; !seen[h.idx()]; h = mesh.next_halfedge_handle(h)) {
      seen[h.idx()] = 1;
      ++lengths.back();
    }
  }
  return lengths;
}

TEST(Import, KeepsWhatIsManifold) {
  for (const Mesh& mesh :
       {testing::Plane(4, 3), testing::Tetrahedron(), testing::Torus(8, 6), testing::Cylinder(8, 3)}) {
    const TriMesh imported = Imported(mesh);
    ExpectManifold(mesh, imported);
    ASSERT_EQ(imported.n_vertices(), mesh.positions.size());
    for (const VertexHandle v : imported.vertices()) {
      EXPECT_EQ(imported.data(v).source, v.idx());
      EXPECT_EQ(imported.point(v), mesh.positions[v.idx()]);
    }
  }
  EXPECT_THAT(LoopLengths(Imported(testing::Torus(8, 6))), IsEmpty());
  EXPECT_THAT(LoopLengths(Imported(testing::Cylinder(8, 3))), ElementsAre(8, 8));
}

TEST(Import, PartsFacesAtNonManifoldEdgesForADiagnosis) {
  const Mesh fan = {{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}};
  const Pairing pairing = PairHalfEdges(fan, JoinFor::kDiagnosis);
  ASSERT_THAT(pairing.non_manifold, SizeIs(1));
  EXPECT_THAT(pairing.non_manifold[0], ElementsAre(2, 5, 8));
  const TriMesh parted = ImportMesh(fan, pairing.opposite);
  ExpectManifold(fan, parted);
  EXPECT_EQ(parted.n_vertices(), 9u) << "three triangles by themselves";
}

// Faces at one edge along z, from the origin to height 1, each with its third vertex at this angle round the edge in
// degrees; those at negative angles run along the edge downwards.
Mesh FacesRoundAnEdge(const std::vector<double>& degrees) {
  Mesh mesh = {{{0, 0, 0}, {0, 0, 1}}, {}};
  for (const double angle : degrees) {
    const double radians = std::abs(angle) * std::numbers::pi / 180;
    const auto v = static_cast<std::int32_t>(mesh.positions.size());
    mesh.positions.emplace_back(std::cos(radians), std::sin(radians), 0.3);
    mesh.faces.push_back(angle < 0 ? Face{1, 0, v} : Face{0, 1, v});
  }
  return mesh;
}

// Per face, the one that it is joined to at the edge of FacesRoundAnEdge(), or -1.
std::vector<std::int32_t> FaceAcrossTheEdge(const Mesh& mesh) {
  const Pairing pairing = PairHalfEdges(mesh, JoinFor::kCharts);
  std::vector<std::int32_t> joined;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    joined.push_back(pairing.opposite[3 * f + 2] < 0 ? -1 : pairing.opposite[3 * f + 2] / 3);
  }
  ExpectManifold(mesh, ImportMesh(mesh, pairing.opposite));
  return joined;
}

TEST(Import, TheFlattestPairsOfFacesStayJoinedForCharts) {
  EXPECT_THAT(FaceAcrossTheEdge(FacesRoundAnEdge({10, 90, -185})), ElementsAre(2, -1, 0))
      << "a sheet that another one meets";
  EXPECT_THAT(FaceAcrossTheEdge(FacesRoundAnEdge({10, -90, -185})), ElementsAre(2, -1, 0));
  EXPECT_THAT(FaceAcrossTheEdge(FacesRoundAnEdge({10, 90, -190, -270})), ElementsAre(2, 3, 0, 1))
      << "sheets that cross";
  EXPECT_THAT(FaceAcrossTheEdge(FacesRoundAnEdge({10, 90, 185})), ElementsAre(-1, -1, -1))
      << "wound against each other";
}

// Both boxes lie in opposite quadrants round the edge they share: each of the four faces bends by a right angle to two
// others, and goes on with the one of its own box, which is where its normal does not point.
TEST(Import, BoxesThatTouchAlongAnEdgeStayBoxes) {
  for (const bool is_turned : {false, true}) {
    Mesh mesh = FacesRoundAnEdge(is_turned ? std::vector<double>{-360, 90, -180, 270}
                                           : std::vector<double>{360, -90, 180, -270});
    const std::vector<std::int32_t> joined = FaceAcrossTheEdge(mesh);
    for (std::int32_t f = 0; f < 4; ++f) {
      ASSERT_GE(joined[f], 0);
      const auto& [a, b, c] = mesh.faces[f];
      const Vec3 normal = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
      EXPECT_LT(normal.dot(mesh.positions[mesh.faces[joined[f]][2]]), 0) << "turned " << is_turned << ", face " << f;
    }
  }
}

// A flap lies on one of two faces at an edge, and has edges of its own where it is alone. It bends like the face that
// it lies on, and goes on across the edge, since it has nowhere else to go.
TEST(Import, OfEqualBendsThatOfTheFaceWithFewerNeighboursIsJoined) {
  Mesh box = testing::Tetrahedron();
  const Face& face = box.faces[0];
  box.positions.push_back((box.positions[face[0]] + box.positions[face[1]] + box.positions[face[2]]) / 3);
  const Face flap = {face[0], face[1], 4};
  for (const bool is_first : {false, true}) {
    Mesh mesh = box;
    mesh.faces.insert(is_first ? mesh.faces.begin() : mesh.faces.end(), flap);
    const Pairing pairing = PairHalfEdges(mesh, JoinFor::kCharts);
    ASSERT_THAT(pairing.non_manifold, SizeIs(1));
    const std::int32_t f = is_first ? 0 : 4, under = is_first ? 1 : 0;
    EXPECT_GE(pairing.opposite[3 * f + 2], 0);
    EXPECT_EQ(pairing.opposite[3 * under + 2], -1);
    EXPECT_EQ(std::count(pairing.opposite.begin(), pairing.opposite.end(), -1), 3);
  }
}

// Of a face without area nobody knows where it points: it takes what the others leave.
TEST(Import, FacesWithoutAreaTakeWhatIsLeftOfAnEdge) {
  Mesh mesh = FacesRoundAnEdge({0, -0.001, -170});
  mesh.positions[3] = {0, 0, 0.5};
  EXPECT_THAT(FaceAcrossTheEdge(mesh), ElementsAre(2, -1, 0));
  mesh.faces.pop_back();
  EXPECT_THAT(FaceAcrossTheEdge(mesh), ElementsAre(1, 0));
}

// The work at an edge is bounded: beyond 64 faces none are joined.
TEST(Import, EdgesOfVeryManyFacesPartThemAll) {
  for (const int faces : {64, 66}) {
    std::vector<double> degrees;
    for (int i = 0; i < faces; ++i) degrees.push_back((i % 2 == 0 ? 1 : -1) * (1 + 5.0 * i));
    const std::vector<std::int32_t> joined = FaceAcrossTheEdge(FacesRoundAnEdge(degrees));
    EXPECT_EQ(std::count(joined.begin(), joined.end(), -1), faces <= 64 ? 0 : faces);
  }
}

TEST(Import, PartsFacesAtVerticesAndWhereTheyAreWoundAgainstEachOther) {
  const Mesh bow_tie = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}}, {{0, 1, 2}, {0, 3, 4}}};
  EXPECT_EQ(Imported(bow_tie).n_vertices(), 6u);

  const Mesh turned = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2}, {1, 2, 3}}};
  EXPECT_THAT(PairHalfEdges(turned, JoinFor::kCharts).inconsistent, SizeIs(1));
  EXPECT_EQ(Imported(turned).n_vertices(), 6u);
}

TEST(Import, CopiesAreSheetsOfTheirOwn) {
  Mesh sheets = testing::Plane(3, 3);
  for (const Face& face : testing::Plane(3, 3).faces) sheets.faces.push_back({face[0], face[2], face[1]});
  const TriMesh imported = Imported(sheets);
  ExpectManifold(sheets, imported);
  EXPECT_EQ(imported.n_vertices(), 2 * sheets.positions.size());
  EXPECT_THAT(LoopLengths(imported), SizeIs(2));
}

// Whatever the soup: indices that lead nowhere, faces that repeat a vertex, NaN.
TEST(Import, TakesAnySoup) {
  std::mt19937 random(3);
  for (int round = 0; round < 2000; ++round) {
    Mesh soup;
    const int vertices = 3 + static_cast<int>(random() % 6);
    for (int v = 0; v < vertices; ++v) {
      const auto coordinate = [&] { return static_cast<double>(random() % 3); };
      soup.positions.emplace_back(coordinate(), coordinate(), coordinate());
    }
    if (random() % 10 == 0) soup.positions[0].x() = std::numeric_limits<double>::quiet_NaN();
    const auto id = [&] { return static_cast<std::int32_t>(random() % (vertices + round % 2)); };
    for (unsigned f = 0; f < 1 + random() % 12; ++f) soup.faces.push_back({id(), id(), id()});
    if (random() % 20 == 0) soup.faces[0][0] = -1;
    for (const JoinFor purpose : {JoinFor::kCharts, JoinFor::kDiagnosis}) {
      const Pairing pairing = PairHalfEdges(soup, purpose);
      const TriMesh imported = ImportMesh(soup, pairing.opposite);
      ExpectManifold(soup, imported);
      for (std::int32_t c = 0; c < static_cast<std::int32_t>(pairing.opposite.size()); ++c) {
        EXPECT_EQ(CornerAcross(imported, c), pairing.opposite[c]);
      }
    }
  }
}

}  // namespace
}  // namespace planish
