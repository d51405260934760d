// Models look the same with another map. `tests/bench/run.sh textures` does it with larger images and more points.
#include <atomic>

#include "client/files/surface_projection.h"
#include "core/base/error.h"
#include "gtest/gtest.h"
#include "tests/texture/sample_models.h"

namespace planish {
namespace {

TEST(TextureAccuracy, ModelsLookTheSameWithAnotherMap) {
  constexpr int kPoints = 4000;
  for (const SampleModel& model : SampleModels(12, 160)) {
    SCOPED_TRACE(model.name);
    const MeshFile before = Opened(model.Glb());
    const MeshFile after = WithNewMap(before);
    const ModelDifference difference = CompareModels(before, after, kPoints);
    if (model.materials[0].is_normal) {
      EXPECT_LE(difference.normal_mean_degrees, 2);
    } else if (model.is_smooth) {
      EXPECT_LE(difference.color.mean, 2);
      EXPECT_LE(difference.color.percentile99, 12);
    } else {
      EXPECT_LE(difference.color.mean, 1.1 * ReferenceDifference(before, after, kPoints).mean);
    }
  }
}

// A decimated ball shows the normals and colours of the scan, on its own triangles.
TEST(SurfaceProjection, TheCopyShowsTheScan) {
  const absl::StatusOr<MeshFile> scan = ReadMeshBytes("scan.ply", MeshFormat::kPly, ScanPly(40));
  ASSERT_TRUE(scan.ok()) << scan.status();
  const MeshFile copy = Opened(DecimatedGlb(12));
  OutputOptions output;
  output.path = "out.glb";
  output.format = MeshFormat::kGlb;
  SurfaceProjectionOptions options;
  options.size = 256;
  const absl::StatusOr<ProjectedMesh> projected = ProjectSurface(*scan, copy, output, options);
  ASSERT_TRUE(projected.ok()) << projected.status();
  EXPECT_LE(static_cast<double>(projected->missed), 0.005 * static_cast<double>(projected->texels));
  const MeshFile written = Opened(projected->written.files.back().bytes);
  const ProjectionDifference difference = CompareWithScan(written, 5000);
  EXPECT_LE(difference.normal_mean_degrees, 3);
  EXPECT_LE(difference.color_mean, 3);
  EXPECT_EQ(written.mesh.num_polygons(), copy.mesh.num_polygons());
  // A cage that the surfaces leave misses, and says so.
  options.cage = 1e-6;
  const absl::StatusOr<ProjectedMesh> narrow = ProjectSurface(*scan, copy, output, options);
  ASSERT_TRUE(narrow.ok()) << narrow.status();
  EXPECT_GT(narrow->missed, narrow->texels / 2);
  output.format = MeshFormat::kObj;
  EXPECT_EQ(ErrorInfoOf(ProjectSurface(*scan, copy, output, options).status()).reason, "OUTPUT_UNSUPPORTED");
  const std::atomic<bool> stop = true;
  output.format = MeshFormat::kGlb;
  output.textures.stop = &stop;
  EXPECT_EQ(ProjectSurface(*scan, copy, output, options).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace planish
