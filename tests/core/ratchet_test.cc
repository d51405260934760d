// What users see of a map may not get worse unnoticed: twenty fixed meshes, for both preferences. After a change that
// is meant, the line that a failure prints replaces the one in kBefore.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <ostream>
#include <string>
#include <vector>

#include "core/base/sanitizers.h"
#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"
#include "tests/testing/families.h"

namespace planish {
namespace {

constexpr SeamPreference kSeams = SeamPreference::kSeams, kTexture = SeamPreference::kTexture;

struct Figures {
  std::size_t charts;
  double seam_length;  // Quality::seam_length
  double visible;      // Quality::visible_seam_length
  double fill;         // Quality::packing_efficiency
  double stretch;      // Quality::stretch_l2
};

struct Row {
  const char* family;  // "spot_seam": that file
  std::uint64_t seed;
  SeamPreference prefer;
  Figures before;
};

constexpr int kFaces = 1500;
// CPU time of all maps over that of the reference loop, which has so many rounds for each map.
constexpr int kRounds = 40;
constexpr double kTimeBefore = 10;

const std::array kBefore = {
    Row{"surface_nets", 1, kSeams, {191, 39.19, 5.64, 0.566, 1.032}},
    Row{"surface_nets", 1, kTexture, {533, 48.66, 9.24, 0.632, 1.005}},
    Row{"dual_contouring", 2, kSeams, {194, 37.76, 11.98, 0.542, 1.062}},
    Row{"dual_contouring", 2, kTexture, {419, 46.35, 13.62, 0.631, 1.010}},
    Row{"marching_cubes", 3, kSeams, {13, 5.65, 5.00, 0.806, 1.074}},
    Row{"marching_cubes", 3, kTexture, {34, 10.34, 9.18, 0.786, 1.018}},
    Row{"assembly", 1, kSeams, {32, 12.42, 10.30, 0.586, 1.043}},
    Row{"assembly", 1, kTexture, {129, 18.42, 16.01, 0.753, 1.011}},
    Row{"assembly", 4, kSeams, {21, 10.52, 4.37, 0.655, 1.049}},
    Row{"assembly", 4, kTexture, {103, 17.54, 7.31, 0.789, 1.008}},
    Row{"high_genus", 5, kSeams, {3, 5.86, 5.57, 0.526, 1.072}},
    Row{"high_genus", 5, kTexture, {17, 7.92, 7.42, 0.794, 1.014}},
    Row{"quantized", 6, kSeams, {2, 2.84, 2.74, 0.570, 1.059}},
    Row{"quantized", 6, kTexture, {6, 4.67, 4.52, 0.740, 1.024}},
    Row{"slivers", 7, kSeams, {5, 3.64, 3.64, 0.552, 1.018}},
    Row{"slivers", 7, kTexture, {5, 3.64, 3.64, 0.552, 1.018}},
    Row{"skirts", 8, kSeams, {14, 7.59, 5.47, 0.593, 1.097}},
    Row{"skirts", 8, kTexture, {138, 19.72, 12.51, 0.733, 1.009}},
    Row{"thin_sheet", 9, kSeams, {2, 2.84, 2.82, 0.532, 1.002}},
    Row{"thin_sheet", 9, kTexture, {2, 2.84, 2.82, 0.532, 1.002}},
    Row{"decimated", 10, kSeams, {242, 30.70, 11.51, 0.651, 1.093}},
    Row{"decimated", 10, kTexture, {453, 43.67, 19.33, 0.661, 1.013}},
    Row{"levels", 11, kSeams, {27, 0.00, 0.00, 0.759, 1.020}},
    Row{"levels", 11, kTexture, {60, 3.90, 3.02, 0.759, 1.009}},
    Row{"turned", 12, kSeams, {2, 2.51, 2.51, 0.535, 1.000}},
    Row{"turned", 12, kTexture, {2, 2.51, 2.51, 0.535, 1.000}},
    Row{"warped", 13, kSeams, {12, 25.39, 25.39, 0.464, 1.000}},
    Row{"warped", 13, kTexture, {42, 33.79, 33.79, 0.485, 1.000}},
    Row{"cut_up", 14, kSeams, {41, 17.74, 8.60, 0.528, 1.069}},
    Row{"cut_up", 14, kTexture, {147, 25.70, 11.61, 0.678, 1.008}},
    Row{"offset", 2, kSeams, {15, 2.99, 0.81, 0.693, 1.000}},
    Row{"offset", 2, kTexture, {24, 4.04, 1.13, 0.854, 1.000}},
    Row{"uneven", 16, kSeams, {238, 0.00, 0.00, 0.978, 1.000}},
    Row{"uneven", 16, kTexture, {236, 0.00, 0.00, 0.978, 1.000}},
    Row{"winding", 17, kSeams, {51, 3.51, 3.49, 0.136, 1.000}},
    Row{"winding", 17, kTexture, {75, 4.50, 4.42, 0.160, 1.000}},
    Row{"voxels", 18, kSeams, {34, 17.24, 7.92, 0.596, 1.054}},
    Row{"voxels", 18, kTexture, {124, 24.99, 12.05, 0.695, 1.009}},
    Row{"spot_seam", 0, kSeams, {4, 2.18, 1.94, 0.668, 1.112}},
    Row{"spot_seam", 0, kTexture, {36, 8.43, 7.63, 0.817, 1.015}},
};

Mesh MeshOf(const Row& row) {
  if (std::string(row.family) != "spot_seam") return testing::MakeFamily(row.family, row.seed, kFaces);
  return testing::ReadTriangleObj(std::string(PLANISH_TEST_DATA) + "/spot_seam.obj");
}

double CpuSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Products of a sparse matrix and a vector, much like what the solver does. Returns what depends on each of them.
double ReferenceLoop(int rounds) {
  constexpr std::uint32_t kSize = 1 << 14;
  std::vector<double> x(kSize, 1), y(kSize);
  for (int round = 0; round < rounds; ++round) {
    for (std::uint32_t i = 0; i < kSize; ++i) {
      double sum = x[i];
      for (std::uint32_t k = 1; k < 8; ++k) sum -= x[(i * 2654435761U + k * 40503U) % kSize] / (k + 1);
      y[i] = 0.5 * sum;
    }
    x.swap(y);
  }
  return x[0];
}

class Ratchet : public ::testing::Test {
 protected:
  static UnwrapResult Map(const Row& row, const Mesh& mesh) {
    UnwrapOptions options;
    options.seams.prefer = row.prefer;
    absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, {});
    EXPECT_TRUE(result.ok()) << row.family << ' ' << result.status();
    return result.ok() ? *std::move(result) : UnwrapResult();
  }
};

TEST_F(Ratchet, MapsAreNoWorseThanBefore) {
  double seconds = 0, reference = 0, sink = 0;
  for (const Row& row : kBefore) {
    const Mesh mesh = MeshOf(row);
    const double begin = CpuSeconds();
    sink += ReferenceLoop(kRounds);
    const double between = CpuSeconds();
    const UnwrapResult result = Map(row, mesh);
    seconds += CpuSeconds() - between;
    reference += between - begin;
    const Quality& now = result.quality;
    const Figures& before = row.before;
    char line[200];
    std::snprintf(line, sizeof(line), "Row{\"%s\", %d, %s, {%zu, %.2f, %.2f, %.3f, %.3f}},", row.family,
                  static_cast<int>(row.seed), row.prefer == kSeams ? "kSeams" : "kTexture", result.charts.size(),
                  now.seam_length, now.visible_seam_length, now.packing_efficiency, now.stretch_l2);
    EXPECT_LE(static_cast<double>(result.charts.size()), 1.05 * static_cast<double>(before.charts) + 1) << line;
    EXPECT_LE(now.seam_length, 1.05 * before.seam_length + 0.05) << line;
    EXPECT_LE(now.visible_seam_length, 1.08 * before.visible + 0.05) << line;
    EXPECT_GE(now.packing_efficiency, before.fill - 0.02) << line;
    EXPECT_LE(now.stretch_l2, before.stretch + 0.01) << line;
  }
  EXPECT_TRUE(std::isfinite(sink));
  const double time = seconds / reference;
  RecordProperty("relative_time", std::to_string(time));
  std::printf("time over that of the reference loop: %.2f, before %.2f\n", time, kTimeBefore);
  if (!kSanitized) {
    EXPECT_LE(time, 1.5 * kTimeBefore);
  }
}

}  // namespace
}  // namespace planish
