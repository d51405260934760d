// What the library makes of a mesh before it travels.
#include "client/src/mesh_packer.h"

#include "core/draco/codec.h"
#include "gtest/gtest.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using testing::kPositions;
using testing::kTriangles;

// Found on surveyed scans: at coordinates near 20,000 float has steps of 2 mm, and triangles lost their area.
TEST(PackedMesh, PositionsFarFromTheOriginKeepTheirDigits) {
  std::vector<double> positions(kPositions.begin(), kPositions.end());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    positions[i] = 20000.1 * static_cast<double>(i % 3) + positions[i] / 1024;
  }
  const absl::StatusOr<Mesh> sent = DecodeDraco(PackedMesh::Of({positions, kTriangles}).draco);
  ASSERT_TRUE(sent.ok()) << sent.status();
  ASSERT_EQ(sent->num_vertices(), 4);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const int axis = static_cast<int>(i % 3);
    const double edge = sent->positions[i / 3][axis] - sent->positions[0][axis];
    EXPECT_NEAR(edge, positions[i] - positions[i % 3], 1e-9) << i;
  }
}

TEST(PackedMesh, PositionsThatAreFloatsStayAsTheyAre) {
  std::vector<double> positions(kPositions.begin(), kPositions.end());
  const std::string near = PackedMesh::Of({kPositions, kTriangles}).draco;
  EXPECT_EQ(PackedMesh::Of({positions, kTriangles}).draco, near);
  std::vector<float> far = kPositions;
  for (float& x : far) x += 20000;
  const absl::StatusOr<Mesh> sent = DecodeDraco(PackedMesh::Of({far, kTriangles}).draco);
  ASSERT_TRUE(sent.ok()) << sent.status();
  EXPECT_EQ(sent->positions[2], Vec3(20001, 20001, 20000));
}

}  // namespace
}  // namespace planish
