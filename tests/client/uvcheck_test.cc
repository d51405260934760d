// The judge of UV against ../shared/tools/uvcheck, an independent one, on the meshes of ../shared that have UV.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "client/cli/check.h"
#include "gtest/gtest.h"
#include "planish/error.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

using Triangle = std::array<Vec2, 3>;

Triangle TriangleOf(const CheckedMap& map, std::int32_t face) {
  Triangle triangle;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t corner = 3 * static_cast<std::size_t>(face) + k;
    triangle[k] = {map.uv[2 * corner], map.uv[2 * corner + 1]};
  }
  return triangle;
}

// Whether uvcheck takes the two for overlapping: on no axis across an edge are they apart, or overlap by no more than
// its tolerance, 1e-6 of the shortest edge and 1e-12 of the largest coordinate.
bool OverlapBeyondTolerance(const Triangle& a, const Triangle& b) {
  double shortest = std::numeric_limits<double>::infinity(), largest = 0;
  for (const Triangle* const t : {&a, &b}) {
    for (std::size_t k = 0; k < 3; ++k) {
      shortest = std::min(shortest, ((*t)[(k + 1) % 3] - (*t)[k]).norm());
      largest = std::max(largest, (*t)[k].cwiseAbs().maxCoeff());
    }
  }
  if (shortest == 0) return false;
  const double tolerance = 1e-6 * shortest + 1e-12 * largest;
  for (const Triangle* const t : {&a, &b}) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2 along = (*t)[(k + 1) % 3] - (*t)[k], across = Vec2(-along.y(), along.x()).normalized();
      const auto range = [&](const Triangle& of) {
        return std::minmax({across.dot(of[0]), across.dot(of[1]), across.dot(of[2])});
      };
      const auto [a_low, a_high] = range(a);
      const auto [b_low, b_high] = range(b);
      if (std::min(a_high, b_high) - std::max(a_low, b_low) <= tolerance) return false;
    }
  }
  return true;
}

// What uvcheck takes for flipped: faces that are turned against the map as a whole. They are those that are flipped in
// their chart, and the others of charts that are mirrored against the map.
std::int64_t TurnedAgainstTheMap(const CheckedMap& map) {
  double area = 0;
  for (std::int32_t f = 0; f < map.mesh.num_faces(); ++f) {
    const Triangle t = TriangleOf(map, f);
    const Vec2 u = t[1] - t[0], v = t[2] - t[0];
    area += u.x() * v.y() - u.y() * v.x();
  }
  std::int64_t turned = 0;
  for (std::size_t f = 0; f < map.mesh.faces.size(); ++f) {
    const std::uint8_t faults = map.check.faults[f];
    const bool is_mirrored = map.check.charts[static_cast<std::size_t>(map.topology.chart_of_face[f])].is_mirrored;
    const bool is_negative = is_mirrored != ((faults & kFlippedFace) != 0);
    turned += (faults & (kDegenerateFace | kFaceWithoutArea)) == 0 && is_negative != (area < 0) ? 1 : 0;
  }
  return turned;
}

// As uvcheck reads it, with the very numbers that were judged. Faces without area on the surface, which it does not know
// as a kind of their own, are left out.
void WriteObj(const CheckedMap& map, const std::string& path) {
  std::ofstream text(path);
  text.precision(17);
  for (const Vec3& p : map.mesh.positions) text << "v " << p.x() << " " << p.y() << " " << p.z() << "\n";
  for (std::size_t c = 0; c < map.uv.size() / 2; ++c)
    text << "vt " << map.uv[2 * c] << " " << map.uv[2 * c + 1] << "\n";
  for (std::size_t f = 0; f < map.mesh.faces.size(); ++f) {
    if ((map.check.faults[f] & kFaceWithoutArea) != 0) continue;
    text << "f";
    for (std::size_t k = 0; k < 3; ++k) text << " " << map.mesh.faces[f][k] + 1 << "/" << 3 * f + k + 1;
    text << "\n";
  }
}

// What uvcheck says of a file, by name: "flips", "degen", "L2", "ovl", ... Empty if it cannot judge it.
std::map<std::string, double> Uvcheck(const std::string& path) {
  std::map<std::string, double> said;
  FILE* const pipe = popen((std::string("'") + PLANISH_UVCHECK + "' '" + path + "'").c_str(), "r");
  if (pipe == nullptr) return said;
  std::string line(4096, '\0');
  const bool has_line = std::fgets(line.data(), static_cast<int>(line.size()), pipe) != nullptr;
  pclose(pipe);
  if (!has_line) return said;
  std::istringstream words(line.c_str());
  for (std::string word; words >> word;) {
    const std::size_t equals = word.find('=');
    if (equals != std::string::npos) said[word.substr(0, equals)] = std::atof(word.c_str() + equals + 1);
  }
  if (said.contains("error")) said.clear();
  return said;
}

TEST(Uvcheck, AgreesOnEverySharedMeshWithUv) {
  const fs::path meshes = PLANISH_SHARED_MESHES;
  if (!fs::exists(meshes / "MANIFEST.tsv") || !fs::exists(PLANISH_UVCHECK)) {
    GTEST_SKIP() << "no shared meshes, or no uvcheck, beside this checkout";
  }
  const TempDir directory;
  int judged = 0, with_flips = 0, with_overlaps = 0;
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(meshes)) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  for (const fs::path& path : paths) {
    if (!FormatOfPath(path.string())) continue;
    SCOPED_TRACE(path.filename().string());
    CheckedMap map;
    try {
      map = CheckMapOf(MeshInput(path.string()), {}, {});
    } catch (const Error&) {
      continue;  // what cannot be read is the business of other tests
    }
    if (!map.has_uv()) continue;
    WriteObj(map, directory.Path("map.obj"));
    std::map<std::string, double> said = Uvcheck(directory.Path("map.obj"));
    const std::int64_t with_area = map.mesh.num_faces() - map.check.without_area;
    if (with_area == 0) continue;
    ASSERT_EQ(said["nf"], static_cast<double>(with_area));
    ++judged;
    const MapCheck& check = map.check;
    ASSERT_FALSE(check.overlaps.limited);
    std::int64_t deep = 0;
    for (std::size_t i = 0; i < check.overlapping_pairs.size(); i += 2) {
      deep += OverlapBeyondTolerance(TriangleOf(map, check.overlapping_pairs[i]),
                                     TriangleOf(map, check.overlapping_pairs[i + 1]))
                  ? 1
                  : 0;
    }
    EXPECT_EQ(deep, said["ovl"]) << "of " << check.overlaps.pairs << " pairs that overlap exactly";
    with_overlaps += deep > 0 ? 1 : 0;
    EXPECT_EQ(TurnedAgainstTheMap(map), said["flips"]);
    if (check.mirrored_charts == 0) {
      EXPECT_EQ(check.flipped, said["flips"]);
      with_flips += check.flipped > 0 ? 1 : 0;
    }
    if (check.uv_area == 0) {
      EXPECT_EQ(check.degenerate, with_area);
      continue;
    }
    EXPECT_EQ(check.degenerate, said["degen"]);
    EXPECT_NEAR(check.stretch_l2, said["L2"], 1e-4 * check.stretch_l2);
  }
  EXPECT_GE(judged, 8);
  EXPECT_GE(with_flips, 1);
  EXPECT_GE(with_overlaps, 1);
}

}  // namespace
}  // namespace planish::cli
