#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <sstream>

#include "core/base/error.h"
#include "core/draco/codec.h"
#include "core/draco/header.h"
#include "draco/compression/decode.h"
#include "draco/compression/expert_encode.h"
#include "draco/core/encoder_buffer.h"
#include "draco/core/varint_encoding.h"
#include "draco/mesh/mesh.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

// A strip of `cells` squares.
Mesh Strip(int cells) {
  Mesh mesh;
  for (int i = 0; i <= cells; ++i) {
    mesh.positions.emplace_back(i, 0, 0);
    mesh.positions.emplace_back(i, 1, 0.1 * i);
  }
  for (std::int32_t i = 0; i < cells; ++i) {
    mesh.faces.push_back({2 * i, 2 * i + 2, 2 * i + 1});
    mesh.faces.push_back({2 * i + 2, 2 * i + 3, 2 * i + 1});
  }
  return mesh;
}

std::unique_ptr<draco::Mesh> Decoded(const std::string& bytes) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  auto mesh = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  return mesh.ok() ? std::move(mesh).value() : nullptr;
}

std::string EncodeAs(const draco::Mesh& mesh, draco::MeshEncoderMethod method) {
  draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(method);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeToBuffer(&buffer).ok());
  return {buffer.data(), buffer.size()};
}

TEST(DracoHeader, OfOurOwnData) {
  for (const int cells : {1, 50, 100, 20'000}) {
    const Mesh mesh = Strip(cells);
    const auto counts = PeekDraco(EncodeDraco(mesh).value());
    ASSERT_TRUE(counts.ok()) << counts.status();
    EXPECT_EQ(counts->geometry, DracoGeometry::kMesh);
    EXPECT_EQ(counts->method, DracoMethod::kSequential);
    EXPECT_EQ(counts->faces, mesh.num_faces());
    EXPECT_EQ(counts->vertices, mesh.num_vertices());
  }
}

TEST(DracoHeader, OfEdgebreaker) {
  for (const int cells : {1, 100, 20'000}) {
    const Mesh mesh = Strip(cells);
    const auto decoded = Decoded(EncodeDraco(mesh).value());
    ASSERT_NE(decoded, nullptr);
    const auto counts = PeekDraco(EncodeAs(*decoded, draco::MESH_EDGEBREAKER_ENCODING));
    ASSERT_TRUE(counts.ok()) << counts.status();
    EXPECT_EQ(counts->method, DracoMethod::kEdgebreaker);
    EXPECT_EQ(counts->faces, mesh.num_faces());
    EXPECT_EQ(counts->vertices, mesh.num_vertices());
  }
}

TEST(DracoHeader, BehindMetadata) {
  const Mesh mesh = Strip(100);
  const auto decoded = Decoded(EncodeDraco(mesh).value());
  ASSERT_NE(decoded, nullptr);
  auto metadata = std::make_unique<draco::GeometryMetadata>();
  metadata->AddEntryString("author", std::string(300, 'x'));
  for (const std::string name : {"a", "b"}) {
    auto inner = std::make_unique<draco::Metadata>();
    inner->AddEntryInt("number", 7);
    auto innermost = std::make_unique<draco::Metadata>();
    innermost->AddEntryDouble("deep", 0.5);
    ASSERT_TRUE(inner->AddSubMetadata("innermost", std::move(innermost)));
    ASSERT_TRUE(metadata->AddSubMetadata(name, std::move(inner)));
  }
  auto of_attribute = std::make_unique<draco::AttributeMetadata>();
  of_attribute->AddEntryString("name", "position");
  decoded->AddMetadata(std::move(metadata));
  decoded->AddAttributeMetadata(0, std::move(of_attribute));
  for (const auto method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const auto counts = PeekDraco(EncodeAs(*decoded, method));
    ASSERT_TRUE(counts.ok()) << counts.status();
    EXPECT_EQ(counts->faces, mesh.num_faces());
    EXPECT_EQ(counts->vertices, mesh.num_vertices());
  }
}

TEST(DracoHeader, WhatIsNoDracoData) {
  const std::string bytes = EncodeDraco(Strip(9)).value();
  for (const std::string& wrong : {std::string(), std::string("D"), bytes.substr(0, 10), std::string(2000, 'x'),
                                   "draco" + bytes.substr(5), "x" + bytes}) {
    const absl::Status status = PeekDraco(wrong).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(Reason(status), "MESH_DECODE_FAILED");
  }
}

TEST(DracoHeader, ACutHeaderKnowsNoCounts) {
  const std::string bytes = EncodeDraco(Strip(2000)).value();
  for (std::size_t size = 11; size < bytes.size(); ++size) {
    const auto counts = PeekDraco(std::string_view(bytes).substr(0, size));
    ASSERT_TRUE(counts.ok());
    EXPECT_EQ(counts->geometry, DracoGeometry::kMesh);
    // Two numbers of two bytes each.
    EXPECT_EQ(counts->faces.has_value(), size >= 15) << size;
    EXPECT_EQ(counts->vertices.has_value(), size >= 15) << size;
    if (size > 100) break;
  }
}

TEST(DracoHeader, UnknownVersionsAndMethods) {
  const std::string bytes = EncodeDraco(Strip(9)).value();
  for (const auto& [at, value] : {std::pair(5, '\0'), {5, '\3'}, {6, '\3'}, {8, '\2'}, {7, '\2'}}) {
    std::string changed = bytes;
    changed[at] = value;
    const auto counts = PeekDraco(changed);
    ASSERT_TRUE(counts.ok()) << counts.status();
    EXPECT_FALSE(counts->faces.has_value()) << at;
    EXPECT_FALSE(counts->vertices.has_value()) << at;
  }
}

// Metadata that declare billions of entries, or nest without end, in few bytes and in many.
TEST(DracoHeader, HostileMetadataTakeNoTime) {
  std::string bytes = EncodeDraco(Strip(9)).value().substr(0, 11);
  bytes[10] = '\x80';
  draco::EncoderBuffer most;
  draco::EncodeVarint(std::uint32_t{0xFFFFFFFF}, &most);
  const std::string varint(most.data(), most.size());
  const auto start = std::chrono::steady_clock::now();
  for (const std::string& unit : {varint, std::string("\x01\x00\x00\x01", 4), std::string("\x00\x00", 2),
                                  std::string("\x00", 1), std::string("\xFF", 1)}) {
    for (const std::size_t size : {10, 1000, 10'000'000}) {
      std::string hostile = bytes;
      while (hostile.size() < size) hostile += unit;
      ASSERT_TRUE(PeekDraco(hostile).ok());
    }
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST(DracoHeader, MutatedBytesAreReadOrRefused) {
  const auto decoded = Decoded(EncodeDraco(Strip(60)).value());
  ASSERT_NE(decoded, nullptr);
  std::mt19937 random(5);
  int known = 0;
  for (const auto method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const std::string bytes = EncodeAs(*decoded, method);
    for (int i = 0; i < 20'000; ++i) {
      std::string changed = bytes.substr(0, 5 + random() % 60);
      for (int k = 0; k < 3; ++k) changed[5 + random() % (changed.size() - 4) % changed.size()] = random() % 256;
      const auto counts = PeekDraco(changed);
      if (!counts.ok()) {
        ASSERT_EQ(Reason(counts.status()), "MESH_DECODE_FAILED");
        continue;
      }
      if (!counts->faces) continue;
      ++known;
      ASSERT_GE(*counts->faces, 0);
      ASSERT_GE(counts->vertices.value(), 0);
      ASSERT_LE(*counts->faces, 0xFFFFFFFF);
    }
  }
  EXPECT_GT(known, 1000);
}

TEST(DracoHeader, OfEverySharedFile) {
  if (!fs::exists(fs::path(PLANISH_SHARED_MESHES) / "MANIFEST.tsv")) {
    GTEST_SKIP() << "no shared meshes at " << PLANISH_SHARED_MESHES;
  }
  int meshes = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(PLANISH_SHARED_MESHES)) {
    if (entry.path().extension() != ".drc") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const std::string bytes = ReadFile(entry.path());
    const auto counts = PeekDraco(bytes);
    ASSERT_TRUE(counts.ok()) << counts.status();
    ASSERT_TRUE(counts->faces.has_value() && counts->vertices.has_value());
    if (counts->geometry == DracoGeometry::kPointCloud) {
      EXPECT_EQ(*counts->faces, 0);
      EXPECT_GT(*counts->vertices, 0);
      continue;
    }
    const auto decoded = Decoded(bytes);
    ASSERT_NE(decoded, nullptr);
    ++meshes;
    EXPECT_EQ(*counts->faces, decoded->num_faces());
    const draco::PointAttribute* position = decoded->GetNamedAttribute(draco::GeometryAttribute::POSITION);
    ASSERT_NE(position, nullptr);
    if (counts->method == DracoMethod::kSequential) {
      EXPECT_EQ(*counts->vertices, decoded->num_points());
    } else {
      EXPECT_EQ(*counts->vertices, static_cast<std::int64_t>(position->size()));
    }
  }
  EXPECT_GE(meshes, 12);
}

TEST(DracoLimits, HoldBeforeAndAfterDecoding) {
  const Mesh mesh = Strip(50);
  const std::string bytes = EncodeDraco(mesh).value();
  EXPECT_TRUE(DecodeDraco(bytes, {mesh.num_faces(), mesh.num_vertices()}).ok());
  const auto expect_too_large = [](const absl::Status& status, const std::string& element, const std::string& declared,
                                   const std::string& limit) {
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    const ErrorInfo info = ErrorInfoOf(status);
    EXPECT_EQ(info.reason, "MESH_TOO_LARGE");
    EXPECT_EQ(info.metadata,
              (std::map<std::string, std::string>{{"element", element}, {"declared", declared}, {"limit", limit}}));
  };
  expect_too_large(DecodeDraco(bytes, {99, 1000}).status(), "faces", "100", "99");
  expect_too_large(DecodeDraco(bytes, {1000, 101}).status(), "vertices", "102", "101");
  // By the first bytes alone: the rest is missing.
  expect_too_large(DecodeDraco(bytes.substr(0, 20), {99, 1000}).status(), "faces", "100", "99");
  EXPECT_EQ(Reason(DecodeDraco(bytes.substr(0, 20), {100, 1000}).status()), "MESH_DECODE_FAILED");
}

}  // namespace
}  // namespace planish
