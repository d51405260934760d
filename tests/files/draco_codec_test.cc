#include <bit>
#include <limits>
#include <random>

#include "core/base/error.h"
#include "core/draco/codec.h"
#include "draco/compression/expert_encode.h"
#include "draco/mesh/mesh.h"
#include "draco/mesh/triangle_soup_mesh_builder.h"
#include "draco/point_cloud/point_cloud_builder.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

void ExpectSame(const Mesh& a, const Mesh& b) {
  EXPECT_EQ(a.faces, b.faces);
  ASSERT_EQ(a.num_vertices(), b.num_vertices());
  for (std::int64_t v = 0; v < a.num_vertices(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      // By bits: 0 differs from -0, a NaN is equal to itself.
      ASSERT_EQ(std::bit_cast<std::uint64_t>(a.positions[v][axis]), std::bit_cast<std::uint64_t>(b.positions[v][axis]))
          << "vertex " << v;
    }
  }
}

void ExpectRoundTrip(const Mesh& mesh) {
  const auto bytes = EncodeDraco(mesh);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto decoded = DecodeDraco(*bytes);
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  ExpectSame(mesh, *decoded);
}

// `values` positions drawn from all finite and infinite floats, faces drawn at random.
Mesh RandomMesh(int vertices, int faces, int seed) {
  std::mt19937 random(seed);
  Mesh mesh;
  for (int v = 0; v < vertices; ++v) {
    Vec3 position;
    for (double& value : position) {
      float bits = 0;
      do {
        bits = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
      } while (bits != bits);
      value = bits;
    }
    mesh.positions.push_back(position);
  }
  for (int f = 0; f < faces; ++f) {
    Face face;
    for (std::int32_t& vertex : face) vertex = static_cast<std::int32_t>(random() % vertices);
    mesh.faces.push_back(face);
  }
  return mesh;
}

TEST(Draco, RoundTripIsTheIdentity) {
  for (int seed = 0; seed < 50; ++seed) ExpectRoundTrip(RandomMesh(1 + seed * 7, 3 + seed * 5, seed));
}

TEST(Draco, RoundTripOfEveryIndexWidth) {
  for (const int vertices : {255, 256, 257, 65535, 65536, 65537, 300000}) {
    ExpectRoundTrip(RandomMesh(vertices, vertices / 2 + 1, vertices));
  }
}

TEST(Draco, DuplicateAndDegenerateFacesSurvive) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}, {-0.0, 0, 0}, {9, 9, 9}};
  mesh.faces = {{2, 0, 1}, {0, 1, 2}, {0, 1, 2}, {1, 0, 2}, {0, 0, 0}, {1, 2, 1}, {4, 3, 1}};
  ExpectRoundTrip(mesh);
}

// The decoder refuses data of fewer than three bytes a face, to which equal faces compress.
TEST(Draco, ManyFacesOnFewVertices) {
  for (const int faces : {1, 11, 12, 13, 1000, 100000}) {
    for (const Face& face : {Face{0, 0, 0}, Face{0, 1, 2}}) {
      Mesh mesh;
      mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
      mesh.faces.assign(faces, face);
      ExpectRoundTrip(mesh);
    }
  }
  for (const int faces : {1000, 1200, 1201, 1300, 5000}) ExpectRoundTrip(RandomMesh(300, faces, faces));
}

TEST(Draco, SpecialValuesKeepTheirBits) {
  Mesh mesh;
  const float denormal = std::bit_cast<float>(1u);
  const float nan = std::bit_cast<float>(0x7FC12345u);
  mesh.positions = {{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(), nan},
                    {-0.0, denormal, std::numeric_limits<float>::max()},
                    {-nan, 1e-30f, std::numeric_limits<float>::min()}};
  mesh.faces = {{0, 1, 2}};
  ExpectRoundTrip(mesh);
}

TEST(Draco, RoundsToFloat) {
  Mesh mesh;
  mesh.positions = {{0.1, 1.0 / 3, 1e-60}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}};
  const auto decoded = DecodeDraco(EncodeDraco(mesh).value());
  ASSERT_TRUE(decoded.ok());
  EXPECT_EQ(decoded->positions[0], Vec3(0.1f, 1.0f / 3, 0));
}

TEST(Draco, CompressesConnectivity) {
  Mesh mesh;
  constexpr int kSide = 60;
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; j <= kSide; ++j) mesh.positions.emplace_back(i, j, 0);
  }
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const std::int32_t a = i * (kSide + 1) + j;
      mesh.faces.push_back({a, a + 1, a + kSide + 2});
      mesh.faces.push_back({a, a + kSide + 2, a + kSide + 1});
    }
  }
  const auto bytes = EncodeDraco(mesh);
  ASSERT_TRUE(bytes.ok());
  EXPECT_LT(bytes->size(), 0.5 * 12 * (mesh.positions.size() + mesh.faces.size()));
}

TEST(Draco, WhatCannotBeEncoded) {
  const Mesh good = Triangulate(SamplePolygons()).mesh;
  Mesh mesh = good;
  mesh.faces.clear();
  EXPECT_EQ(Reason(EncodeDraco(mesh).status()), "MESH_EMPTY");
  EXPECT_EQ(Reason(EncodeDraco(Mesh()).status()), "MESH_EMPTY");

  for (const std::int32_t index : {-1, 5, std::numeric_limits<std::int32_t>::max()}) {
    mesh = good;
    mesh.faces[1][2] = index;
    const absl::Status status = EncodeDraco(mesh).status();
    EXPECT_EQ(Reason(status), "MESH_INDEX_OUT_OF_RANGE");
    EXPECT_THAT(std::string(status.message()), HasSubstr("a face has the index " + std::to_string(index)));
    EXPECT_EQ(ErrorInfoOf(status).metadata.at("faces"), "1");
  }

  mesh = good;
  mesh.positions.resize(9, Vec3::Zero());
  ExpectRoundTrip(mesh);
  mesh.positions.resize(10, Vec3::Zero());
  EXPECT_EQ(EncodeDraco(mesh).status().code(), absl::StatusCode::kInvalidArgument);

  mesh = good;
  mesh.positions[2].y() = -1e39;
  const absl::Status status = EncodeDraco(mesh).status();
  EXPECT_EQ(Reason(status), "MESH_POSITION_INVALID");
  EXPECT_THAT(std::string(status.message()), HasSubstr("a vertex lies outside the range of float"));
  EXPECT_EQ(ErrorInfoOf(status).metadata.at("vertices"), "2");
  // Rounds down to the largest float, not up to infinity.
  mesh.positions[2].y() = 3.4028235e38;
  EXPECT_TRUE(EncodeDraco(mesh).ok());
}

std::string Encode(const draco::Mesh& mesh, draco::MeshEncoderMethod method, int speed = 5) {
  draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(method);
  encoder.SetSpeedOptions(speed, speed);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
  return {buffer.data(), buffer.size()};
}

// Two triangles at an edge; corners of the second have texture coordinates shifted by `shift`.
std::unique_ptr<draco::Mesh> TexturedQuad(float shift) {
  const float positions[6][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(2);
  const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int texture = builder.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  for (int f = 0; f < 2; ++f) {
    const float(*p)[3] = positions + 3 * f;
    float uv[3][2];
    for (int k = 0; k < 3; ++k) {
      uv[k][0] = p[k][0] + static_cast<float>(f) * shift;
      uv[k][1] = p[k][1];
    }
    builder.SetAttributeValuesForFace(position, draco::FaceIndex(f), p[0], p[1], p[2]);
    builder.SetAttributeValuesForFace(texture, draco::FaceIndex(f), uv[0], uv[1], uv[2]);
  }
  return builder.Finalize();
}

TEST(Draco, UvSeamsDoNotTearTheMesh) {
  const auto quad = TexturedQuad(5);
  ASSERT_EQ(quad->num_points(), 6u);
  for (const auto method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const auto mesh = DecodeDraco(Encode(*quad, method));
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->num_vertices(), 4) << method;
    EXPECT_EQ(mesh->num_faces(), 2);
  }
  const auto mesh = DecodeDraco(Encode(*quad, draco::MESH_SEQUENTIAL_ENCODING));
  const Mesh expected = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  ExpectSame(*mesh, expected);
}

TEST(Draco, CutsStayCut) {
  // Points at the same place with the same texture coordinates were kept apart on purpose.
  draco::Mesh quad;
  quad.set_num_points(6);
  const float positions[6][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  for (const auto& [type, components] :
       {std::pair(draco::GeometryAttribute::POSITION, 3), std::pair(draco::GeometryAttribute::TEX_COORD, 2)}) {
    draco::GeometryAttribute attribute;
    attribute.Init(type, nullptr, static_cast<std::int8_t>(components), draco::DT_FLOAT32, false, 4 * components, 0);
    const int id = quad.AddAttribute(attribute, true, 6);
    for (std::uint32_t v = 0; v < 6; ++v) {
      quad.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(v), positions[v]);
    }
  }
  quad.AddFace({draco::PointIndex(0), draco::PointIndex(1), draco::PointIndex(2)});
  quad.AddFace({draco::PointIndex(3), draco::PointIndex(4), draco::PointIndex(5)});
  const auto mesh = DecodeDraco(Encode(quad, draco::MESH_SEQUENTIAL_ENCODING));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->num_vertices(), 6);
}

std::string WithPosition(int components, draco::DataType type, int count) {
  draco::Mesh mesh;
  mesh.set_num_points(3);
  for (int i = 0; i < count; ++i) {
    draco::GeometryAttribute attribute;
    attribute.Init(draco::GeometryAttribute::POSITION, nullptr, static_cast<std::int8_t>(components), type, false,
                   components * draco::DataTypeLength(type), 0);
    mesh.AddAttribute(attribute, true, 3);
  }
  mesh.AddFace({draco::PointIndex(0), draco::PointIndex(1), draco::PointIndex(2)});
  return Encode(mesh, draco::MESH_SEQUENTIAL_ENCODING);
}

TEST(Draco, PositionsMustBeOneAttributeOfThreeFloats) {
  EXPECT_TRUE(DecodeDraco(WithPosition(3, draco::DT_FLOAT32, 1)).ok());
  const std::string wrong[] = {WithPosition(2, draco::DT_FLOAT32, 1), WithPosition(4, draco::DT_FLOAT32, 1),
                               WithPosition(3, draco::DT_INT32, 1), WithPosition(3, draco::DT_FLOAT64, 1),
                               WithPosition(3, draco::DT_FLOAT32, 2)};
  for (const std::string& bytes : wrong) {
    const absl::Status status = DecodeDraco(bytes).status();
    EXPECT_EQ(Reason(status), "MESH_POSITION_INVALID") << status;
  }
}

TEST(Draco, PointCloudIsNoMesh) {
  draco::PointCloudBuilder builder;
  builder.Start(3);
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  builder.SetAttributeValuesForAllPoints(id, positions, 0);
  const auto cloud = builder.Finalize(false);
  draco::ExpertEncoder encoder(*cloud);
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
  const absl::Status status = DecodeDraco(std::string(buffer.data(), buffer.size())).status();
  EXPECT_EQ(Reason(status), "MESH_NOT_A_MESH");
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
}

TEST(Draco, TruncatedBytesAreRefused) {
  const std::string bytes = EncodeDraco(Triangulate(SamplePolygons()).mesh).value();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const absl::Status status = DecodeDraco(bytes.substr(0, size)).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << size;
    EXPECT_EQ(Reason(status), "MESH_DECODE_FAILED") << size;
  }
}

}  // namespace
}  // namespace planish
