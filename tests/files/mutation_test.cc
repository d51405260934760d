// Damaged files: every reader ends with valid polygons or an error of its own kind, in little time and memory.
// PLANISH_IO_MUTATIONS sets the number of damaged files per format (default 2000).
#include <cstdlib>
#include <cstring>
#include <random>

#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "client/files/readers.h"
#include "core/draco/codec.h"
#include "gtest/gtest.h"
#include "tests/files/gltf_fixture.h"
#include "tests/files/sample_meshes.h"

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

struct Mutant {
  std::string name;
  absl::StatusOr<PolygonMesh> (*reader)(const std::string&, std::string_view);
  std::string (*bytes)();
  MeshFormat format;
};

void PrintTo(const Mutant& sample, std::ostream* out) {
  *out << sample.name;
}

class Mutation : public ::testing::TestWithParam<Mutant> {};

TEST_P(Mutation, EndsWell) {
  std::mt19937 random(7);
  const std::string original = GetParam().bytes();
  int refused = 0;
  for (int i = 0; i < NumMutations(); ++i) {
    const std::string bytes = Mutated(original, random);
    const auto mesh = GetParam().reader("in", bytes);
    if (mesh.ok()) {
      ExpectValid(*mesh);
      // What the reader takes the writer keeps: the same faces on the way back, whatever the file looks like.
      MeshFile file;
      file.path = "in";
      file.format = GetParam().format;
      file.bytes = bytes;
      file.mesh = *mesh;
      if (file.format == MeshFormat::kStl) continue;
      OutputOptions output;
      output.format = file.format;
      const auto written = WriteMeshWithUv(file, std::vector<double>(2 * mesh->corner_vertex.size()), output);
      ASSERT_TRUE(written.ok()) << written.status() << "\n" << bytes;
      const auto again = GetParam().reader("out", written->files[0].bytes);
      ASSERT_TRUE(again.ok()) << again.status() << "\n" << bytes << "\n" << written->files[0].bytes;
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

std::string SamplePlyWithUv() {
  return "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty "
         "float s\n"
         "property float t\nelement face 2\nproperty list uchar int vertex_indices\nproperty list uchar float "
         "texcoord\n"
         "end_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 1 1 0 1\n";
}

std::string SampleStoff() {
  return "STOFF\n4 2 0\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1 # c\n0 1 0 0 1\n3 0 1 2 255 0 0\n3 0 2 3\n";
}

INSTANTIATE_TEST_SUITE_P(
    All, Mutation,
    ::testing::Values(Mutant{"obj", ReadObj, SampleObj, MeshFormat::kObj},
                      Mutant{"tricky_obj", ReadObj, TrickyObj, MeshFormat::kObj},
                      Mutant{"ply", ReadPly, SamplePlyAscii, MeshFormat::kPly},
                      Mutant{"ply_little", ReadPly, [] { return SamplePlyBinary(false); }, MeshFormat::kPly},
                      Mutant{"ply_big", ReadPly, [] { return SamplePlyBinary(true); }, MeshFormat::kPly},
                      Mutant{"ply_uv", ReadPly, SamplePlyWithUv, MeshFormat::kPly},
                      Mutant{"stoff", ReadOff, SampleStoff, MeshFormat::kOff},
                      Mutant{"off", ReadOff, SampleOff, MeshFormat::kOff},
                      Mutant{"stl", ReadStl, SampleStlAscii, MeshFormat::kStl},
                      Mutant{"stl_binary", ReadStl, SampleStlBinary, MeshFormat::kStl}),
    [](const auto& sample) { return sample.param.name; });

// JSON and bytes apart: a damaged GLB is nearly always a damaged JSON text.
class GltfMutation : public ::testing::TestWithParam<bool> {};

TEST_P(GltfMutation, EndsWell) {
  std::mt19937 random(7);
  const GltfFixture fixture = GetParam() ? SampleDracoGltf() : SampleGltf();
  const std::string glb = fixture.Glb();
  // Numbers of the JSON that are replaced by others.
  std::vector<Json::json_pointer> numbers;
  const Json flat = fixture.json.flatten();
  for (const auto& [pointer, value] : flat.items()) {
    if (value.is_number()) numbers.emplace_back(pointer);
  }
  const std::vector<Json> others = {0,
                                    1,
                                    2,
                                    3,
                                    5,
                                    7,
                                    11,
                                    12,
                                    13,
                                    255,
                                    65535,
                                    2147483647,
                                    4294967295u,
                                    9007199254740992,
                                    18446744073709551615u,
                                    -1,
                                    0.5,
                                    1e300,
                                    nullptr,
                                    "x",
                                    Json::array(),
                                    Json::object()};
  int refused = 0;
  int written_again = 0;
  for (int i = 0; i < NumMutations(); ++i) {
    std::string bytes;
    if (i % 4 == 0) {
      bytes = Mutated(glb, random);
    } else {
      GltfFixture damaged = fixture;
      for (std::size_t k = 0; k <= random() % 2; ++k) {
        Json& victim = damaged.json[numbers[random() % numbers.size()]];
        victim = others[random() % others.size()];
      }
      for (std::size_t k = random() % 4; k < 3; ++k) {
        damaged.buffer[random() % damaged.buffer.size()] = static_cast<char>(random());
      }
      bytes = i % 4 == 1 ? damaged.Gltf() : damaged.Glb();
    }
    MeshFile file;
    file.path = "in";
    const auto mesh = ReadGltf("in", bytes, 0, &file.gltf);
    if (!mesh.ok()) {
      ++refused;
      EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
      EXPECT_EQ(Reason(mesh.status()), "FILE_MALFORMED") << mesh.status();
      continue;
    }
    ExpectValid(*mesh);
    file.format = MeshFormat::kGlb;
    file.mesh = *mesh;
    std::vector<double> uv;
    for (std::size_t c = 0; c < mesh->corner_vertex.size(); ++c) {
      uv.insert(uv.end(), {static_cast<double>(c % 7) / 8, static_cast<double>(c % 3) / 4});
    }
    OutputOptions options;
    options.format = MeshFormat::kGlb;
    const auto written = WriteMeshWithUv(file, uv, options);
    // Damage that turns floats into integers may leave some that Draco cannot encode.
    if (GetParam() && Reason(written.status()) == "OUTPUT_UNSUPPORTED") continue;
    ASSERT_TRUE(written.ok()) << written.status() << "\n" << file.gltf->document.json.dump();
    std::shared_ptr<const GltfMesh> ignored;
    const auto again = ReadGltf("out", written->files[0].bytes, 0, &ignored);
    ASSERT_TRUE(again.ok()) << again.status() << "\n" << file.gltf->document.json.dump();
    // Vertices without a face may give way to copies of others, so only places can be compared.
    ASSERT_EQ(again->corner_vertex.size(), mesh->corner_vertex.size());
    for (std::size_t c = 0; c < mesh->corner_vertex.size(); ++c) {
      const Vec3& before = mesh->positions[mesh->corner_vertex[c]];
      const Vec3& after = again->positions[again->corner_vertex[c]];
      EXPECT_EQ(std::memcmp(before.data(), after.data(), sizeof(Vec3)), 0);
    }
    ++written_again;
  }
  EXPECT_GT(refused, NumMutations() / 10);
  EXPECT_GT(written_again, NumMutations() / 10);
}

INSTANTIATE_TEST_SUITE_P(All, GltfMutation, ::testing::Bool(),
                         [](const auto& draco) { return draco.param ? "draco" : "plain"; });

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
