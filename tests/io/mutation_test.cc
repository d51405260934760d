// Damaged files: every reader ends with valid polygons or an error of its own kind, in little time and memory.
// PLANISH_IO_MUTATIONS sets the number of damaged files per format (default 2000).
#include <cstdlib>
#include <random>

#include "core/io/draco_codec.h"
#include "core/io/readers.h"
#include "gtest/gtest.h"
#include "tests/io/sample_meshes.h"

namespace planish {
namespace {

int NumMutations() {
  const char* const text = std::getenv("PLANISH_IO_MUTATIONS");
  return text == nullptr ? 2000 : std::atoi(text);
}

std::string Mutated(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : random() % n; };
  const int changes = 1 + static_cast<int>(below(3));
  for (int i = 0; i < changes; ++i) {
    const std::size_t at = below(bytes.size());
    switch (below(7)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        if (!bytes.empty()) bytes[at] = static_cast<char>(random());
        break;
      case 2:
        if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ 1 << below(8));
        break;
      case 3:
        bytes.insert(at, std::string(1 + below(12), "0123456789 \n-./#\\\r"[below(18)]));
        break;
      case 4:
        bytes.erase(at, 1 + below(30));
        break;
      case 5:
        bytes.insert(below(bytes.size()), bytes.substr(at, below(40)));
        break;
      default:
        for (std::size_t k = at; k < std::min(at + 4, bytes.size()); ++k) bytes[k] = '\xFF';
    }
  }
  return bytes;
}

void ExpectValid(const PolygonMesh& mesh) {
  const std::int64_t vertices = static_cast<std::int64_t>(mesh.positions.size());
  ASSERT_EQ(mesh.polygon_begin.front(), 0);
  ASSERT_EQ(mesh.polygon_begin.back(), static_cast<std::int64_t>(mesh.corner_vertex.size()));
  EXPECT_GT(mesh.num_polygons(), 0);
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    EXPECT_GE(mesh.polygon_begin[p + 1] - mesh.polygon_begin[p], 3);
  }
  for (const std::int32_t vertex : mesh.corner_vertex) {
    ASSERT_GE(vertex, 0);
    ASSERT_LT(vertex, vertices);
  }
  EXPECT_TRUE(mesh.vertex_line.empty() || mesh.vertex_line.size() == mesh.positions.size());
  EXPECT_TRUE(mesh.polygon_line.empty() || static_cast<std::int64_t>(mesh.polygon_line.size()) == mesh.num_polygons());
}

struct Sample {
  std::string name;
  absl::StatusOr<PolygonMesh> (*reader)(const std::string&, std::string_view);
  std::string (*bytes)();
};

void PrintTo(const Sample& sample, std::ostream* out) {
  *out << sample.name;
}

class Mutation : public testing::TestWithParam<Sample> {};

TEST_P(Mutation, EndsWell) {
  std::mt19937 random(7);
  const std::string original = GetParam().bytes();
  int refused = 0;
  for (int i = 0; i < NumMutations(); ++i) {
    const std::string bytes = Mutated(original, random);
    const auto mesh = GetParam().reader("in", bytes);
    if (mesh.ok()) {
      ExpectValid(*mesh);
      if (GetParam().reader != &ReadObj) continue;
      // What the reader takes the writer keeps: the same faces on the way back, whatever the text looks like.
      MeshFile file;
      file.bytes = bytes;
      file.mesh = *mesh;
      const auto again =
          ReadObj("out", WriteObjWithUv(file, std::vector<double>(2 * mesh->corner_vertex.size()), true));
      ASSERT_TRUE(again.ok()) << again.status() << "\n" << bytes;
      EXPECT_EQ(again->corner_vertex, mesh->corner_vertex) << bytes;
      EXPECT_EQ(again->polygon_begin, mesh->polygon_begin) << bytes;
    } else {
      ++refused;
      EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
      EXPECT_EQ(Reason(mesh.status()), "FILE_MALFORMED");
    }
  }
  EXPECT_GT(refused, NumMutations() / 10) << "the damage is too mild to test anything";
}

std::string TrickyObj() {
  return "\xEF\xBB\xBF# x \\\r\nv 0 0 0 1\r\nv 1 0 0\r\nvt 0 0\r\nv 1 1 \\\r\n 0\r\nvn 0 0 1\r\ng a\r\nf 1/1/1 2/1/1 "
         "-1/1/1 # c\r\nl 1/1 2\r\nf 1//1 \\\r\n 2 3#x\r\nf -3 -2 -1";
}

INSTANTIATE_TEST_SUITE_P(All, Mutation,
                         testing::Values(Sample{"obj", ReadObj, SampleObj}, Sample{"tricky_obj", ReadObj, TrickyObj},
                                         Sample{"ply", ReadPly, SamplePlyAscii},
                                         Sample{"ply_little", ReadPly, [] { return SamplePlyBinary(false); }},
                                         Sample{"ply_big", ReadPly, [] { return SamplePlyBinary(true); }},
                                         Sample{"off", ReadOff, SampleOff}, Sample{"stl", ReadStl, SampleStlAscii},
                                         Sample{"stl_binary", ReadStl, SampleStlBinary}),
                         [](const auto& sample) { return sample.param.name; });

TEST(DracoMutation, EndsWell) {
  std::mt19937 random(7);
  const std::string original = EncodeDraco(Triangulate(SamplePolygons()).mesh).value();
  int refused = 0;
  for (int i = 0; i < NumMutations(); ++i) {
    const auto mesh = DecodeDraco(Mutated(original, random));
    if (mesh.ok()) {
      EXPECT_GT(mesh->num_faces(), 0);
      for (const Face& face : mesh->faces) {
        for (const std::int32_t vertex : face) {
          ASSERT_GE(vertex, 0);
          ASSERT_LT(vertex, mesh->num_vertices());
        }
      }
    } else {
      ++refused;
      EXPECT_TRUE(mesh.status().code() == absl::StatusCode::kInvalidArgument ||
                  mesh.status().code() == absl::StatusCode::kResourceExhausted)
          << mesh.status();
      EXPECT_NE(Reason(mesh.status()), "");
    }
  }
  EXPECT_GT(refused, NumMutations() / 10);
}

TEST(DracoMutation, RandomBytesAreRefused) {
  std::mt19937 random(11);
  for (int i = 0; i < 1000; ++i) {
    std::string bytes = i % 2 == 0 ? "" : "DRACO\x02\x02\x01";
    const std::size_t size = random() % 200;
    while (bytes.size() < size) bytes += static_cast<char>(random());
    const auto mesh = DecodeDraco(bytes);
    EXPECT_FALSE(mesh.ok()) << i;
  }
}

}  // namespace
}  // namespace planish
