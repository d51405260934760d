#include "tests/files/sample_meshes.h"

#include <bit>
#include <filesystem>
#include <sstream>

#include "client/files/readers.h"
#include "core/base/error.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

template <typename T>
std::string Number(T value) {
  std::ostringstream text;
  text.precision(9);
  text << value;
  return text.str();
}

std::string Coordinates(const Vec3& p) {
  return Number(p.x()) + " " + Number(p.y()) + " " + Number(p.z());
}

std::string Reversed(std::string bytes, bool reverse) {
  return reverse ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
}

std::string PlyHeader(const std::string& format) {
  return "ply\nformat " + format +
         " 1.0\ncomment a sample\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
         "property uchar red\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n";
}

}  // namespace

PolygonMesh SamplePolygons() {
  PolygonMesh mesh;
  mesh.positions = {{0, 0, 0}, {1.5, 0, 0}, {1, 1, 0.25}, {0, 1, 0}, {2, 0.5, 0.125}};
  mesh.corner_vertex = {0, 1, 2, 0, 2, 3, 1, 4, 2};
  mesh.polygon_begin = {0, 3, 6, 9};
  return mesh;
}

std::string SampleObj() {
  std::string text = "# sample\n";
  const PolygonMesh mesh = SamplePolygons();
  for (const Vec3& p : mesh.positions) text += "v " + Coordinates(p) + "\n";
  for (int f = 0; f < 3; ++f) {
    text += "f";
    for (int k = 0; k < 3; ++k) text += " " + Number(mesh.corner_vertex[3 * f + k] + 1);
    text += "\n";
  }
  return text;
}

std::string SamplePlyAscii() {
  std::string text = PlyHeader("ascii");
  const PolygonMesh mesh = SamplePolygons();
  for (const Vec3& p : mesh.positions) text += Coordinates(p) + " 7\n";
  for (int f = 0; f < 3; ++f) {
    text += "3";
    for (int k = 0; k < 3; ++k) text += " " + Number(mesh.corner_vertex[3 * f + k]);
    text += "\n";
  }
  return text;
}

std::string SamplePlyBinary(bool big_endian) {
  std::string bytes = PlyHeader(big_endian ? "binary_big_endian" : "binary_little_endian");
  const PolygonMesh mesh = SamplePolygons();
  for (const Vec3& p : mesh.positions) {
    for (const double value : p) bytes += Reversed(Bytes(static_cast<float>(value)), big_endian);
    bytes += '\x07';
  }
  for (int f = 0; f < 3; ++f) {
    bytes += '\x03';
    for (int k = 0; k < 3; ++k) bytes += Reversed(Bytes(mesh.corner_vertex[3 * f + k]), big_endian);
  }
  return bytes;
}

std::string SampleOff() {
  const std::string ply = SamplePlyAscii();
  return "OFF\n# sample\n5 3 0\n" + ply.substr(ply.find("end_header\n") + 11);
}

std::string SampleStlAscii() {
  std::string text = "solid a sample\n";
  const PolygonMesh mesh = SamplePolygons();
  for (int f = 0; f < 3; ++f) {
    text += "  facet normal 0 0 1\n    outer loop\n";
    for (int k = 0; k < 3; ++k) {
      text += "      vertex " + Coordinates(mesh.positions[mesh.corner_vertex[3 * f + k]]) + "\n";
    }
    text += "    endloop\n  endfacet\n";
  }
  return text + "endsolid a sample\n";
}

std::string SampleStlBinary() {
  std::string bytes = "solid lies: this one is binary";
  bytes.resize(80);
  bytes += Bytes(std::int32_t{3});
  const PolygonMesh mesh = SamplePolygons();
  for (int f = 0; f < 3; ++f) {
    bytes += Bytes(0.0f) + Bytes(0.0f) + Bytes(1.0f);
    for (int k = 0; k < 3; ++k) {
      for (const double value : mesh.positions[mesh.corner_vertex[3 * f + k]])
        bytes += Bytes(static_cast<float>(value));
    }
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string Bytes(float value) {
  return Bytes(std::bit_cast<std::int32_t>(value));
}

std::string Bytes(std::int32_t value) {
  std::string bytes;
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(static_cast<std::uint32_t>(value) >> (8 * i) & 0xFF);
  return bytes;
}

std::string Reason(const absl::Status& status) {
  return ErrorInfoOf(status).reason;
}

std::string TemporaryPath(const std::string& name) {
  static const TempDir directory;
  std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
  for (char& c : test) c = std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  std::filesystem::create_directories(directory.Path(test));
  return directory.Path(test + "/" + name);
}

MeshFile ReadObjText(const std::string& text) {
  MeshFile file;
  file.path = "in.obj";
  file.bytes = text;
  auto mesh = ReadObj(file.path, text);
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  if (mesh.ok()) file.mesh = *std::move(mesh);
  return file;
}

}  // namespace planish
