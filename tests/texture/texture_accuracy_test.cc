// Models look the same with another map. `tests/bench/run.sh textures` does it with larger images and more points.
#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <sstream>
#include <string>

#include "client/files/gltf_document.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/surface_projection.h"
#include "client/texture/image.h"
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
      const Difference reference = ReferenceDifference(before, after, kPoints);
      EXPECT_LE(difference.color.mean, 1.1 * reference.mean);
      EXPECT_LE(difference.color.percentile99, 1.1 * reference.percentile99);
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

// A rectangle in the plane that a function bends, of n x n squares, as OBJ; its UV fill the image.
std::string BentSquare(const Vec2& low, const Vec2& high, int n, const std::function<Vec3(const Vec2&)>& bent) {
  std::ostringstream obj;
  obj.precision(17);
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      const Vec2 uv(static_cast<double>(x) / n, static_cast<double>(y) / n);
      obj << "v " << bent(low + uv.cwiseProduct(high - low)).transpose() << "\nvt " << uv.transpose() << "\n";
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      obj << "f";
      const int a = y * (n + 1) + x + 1;
      for (const int v : {a, a + 1, a + n + 2, a + n + 1}) obj << " " << v << "/" << v;
      obj << "\n";
    }
  }
  return obj.str();
}

MeshFile OpenedObj(const std::string& obj) {
  const absl::StatusOr<MeshFile> file = ReadMeshBytes("in.obj", MeshFormat::kObj, obj);
  EXPECT_TRUE(file.ok()) << file.status();
  return file.value_or(MeshFile());
}

struct Baked {
  ProjectedMesh mesh;
  TextureImage image;  // of heights, else of occlusion

  // The texel at UV, v upwards, from 0 to 1.
  double At(double u, double v) const {
    if (image.texels.empty()) return HUGE_VAL;
    const auto x = static_cast<std::size_t>(u * image.header.width);
    const auto y = static_cast<std::size_t>((1 - v) * image.header.height);
    const std::size_t i = y * static_cast<std::size_t>(image.header.width) + x;
    if (image.header.bits == 8) return image.texels[i] / 255.0;
    return reinterpret_cast<const std::uint16_t*>(image.texels.data())[i] / 65535.0;
  }
  double HeightAt(double u, double v) const {
    if (!mesh.height) return HUGE_VAL;
    return mesh.height->low + (mesh.height->high - mesh.height->low) * At(u, v);
  }
};

Baked Bake(const MeshFile& from, const MeshFile& to, double cage, bool is_height, double occlusion_reach = 1) {
  OutputOptions output;
  output.path = "out.glb";
  output.format = MeshFormat::kGlb;
  SurfaceProjectionOptions options;
  options.size = 64;
  options.cage = cage;
  options.normals = false;
  (is_height ? options.height : options.occlusion) = true;
  options.occlusion_reach = occlusion_reach;
  absl::StatusOr<ProjectedMesh> projected = ProjectSurface(from, to, output, options);
  EXPECT_TRUE(projected.ok()) << projected.status();
  Baked baked;
  if (!projected.ok()) return baked;
  baked.mesh = *std::move(projected);
  EXPECT_EQ(baked.mesh.missed, 0);
  std::string bytes = baked.mesh.written.files[0].bytes;
  if (!is_height) {
    const MeshFile file = Opened(bytes);
    const Json& root = file.gltf->document.json;
    EXPECT_EQ(root["images"].size(), 1u) << root["images"];
    EXPECT_EQ(root["materials"][0]["occlusionTexture"]["index"], 0);
    bytes = GltfImageBytes(file.gltf->document, 0, false).value_or("");
  } else {
    EXPECT_EQ(baked.mesh.height->path, "out_height.png");
  }
  const absl::StatusOr<TextureImage> image = DecodeImage(bytes, "image");
  EXPECT_TRUE(image.ok()) << image.status();
  baked.image = image.value_or(TextureImage());
  EXPECT_EQ(baked.image.header.bits, is_height ? 16 : 8);
  return baked;
}

TEST(SurfaceProjection, HeightsAreDistancesAlongTheNormals) {
  const MeshFile flat =
      OpenedObj(BentSquare(Vec2(0, 0), Vec2(1, 1), 2, [](const Vec2& p) { return Vec3(p.x(), p.y(), 0); }));
  const MeshFile tilted = OpenedObj(BentSquare(Vec2(-0.1, -0.1), Vec2(1.1, 1.1), 3,
                                               [](const Vec2& p) { return Vec3(p.x(), p.y(), 0.1 * p.x() - 0.04); }));
  const Baked tilt = Bake(tilted, flat, 0.2, true);
  for (const double u : {0.1, 0.4, 0.9}) EXPECT_NEAR(tilt.HeightAt(u, 0.3), 0.1 * u - 0.04, 0.1 / 64) << u;
  // A part of a sphere of radius 1.05 over a coarse one of radius 1: the more, the deeper the facets lie.
  const auto sphere = [](double radius) {
    return [radius](const Vec2& p) { return Vec3(radius * Vec3(p.x(), p.y(), 1).normalized()); };
  };
  const MeshFile coarse = OpenedObj(BentSquare(Vec2(-0.5, -0.5), Vec2(0.5, 0.5), 4, sphere(1)));
  const MeshFile fine = OpenedObj(BentSquare(Vec2(-0.8, -0.8), Vec2(0.8, 0.8), 96, sphere(1.05)));
  const Baked shell = Bake(fine, coarse, 0.1, true);
  ASSERT_TRUE(shell.mesh.height);
  // The middle of the diagonal of a square of 0.25 lies deepest.
  const double sagitta = 1 - std::cos(std::atan(std::sqrt(2) * 0.125));
  EXPECT_NEAR(shell.mesh.height->low, 0.05, 2e-3);
  EXPECT_NEAR(shell.mesh.height->high, 0.05 + sagitta, 2e-3);
  EXPECT_GT(sagitta, 0.015);
}

TEST(SurfaceProjection, OcclusionIsThatOfAFloorBesideAWall) {
  // A wall of height 2 at x = 0, far to both sides, and a floor from there.
  const MeshFile corner =
      OpenedObj("v 0 -200 0\nv 50 -200 0\nv 50 200 0\nv 0 200 0\nv 0 -200 2\nv 0 200 2\nf 1 2 3 4\nf 1 4 6 5\n");
  const MeshFile floor =
      OpenedObj(BentSquare(Vec2(0, -2), Vec2(4, 2), 2, [](const Vec2& p) { return Vec3(p.x(), p.y(), 0); }));
  const Baked baked = Bake(corner, floor, 0.01, false);
  double last = 0;
  for (const double u : {0.05, 0.25, 0.5, 0.9}) {
    const double x = (std::floor(u * 64) + 0.5) / 64 * 4;
    double mean = 0;
    for (int i = 0; i < 16; ++i) mean += baked.At(u, (i + 0.5) / 16) / 16;
    EXPECT_NEAR(mean, 1 - (1 - x / std::hypot(x, 2)) / 2, 0.02) << x;
    EXPECT_GT(mean, last);
    last = mean;
  }
  EXPECT_EQ(Bake(corner, floor, 0.01, false).image.texels, baked.image.texels) << "the same each time";
  // Rays of length 1 reach the wall only from places nearer than that.
  const double diagonal = Vec3(50, 400, 2).norm();
  const Baked near = Bake(corner, floor, 0.01, false, 1 / diagonal);
  EXPECT_GT(near.At(0.1, 0.5), baked.At(0.1, 0.5));
  EXPECT_LT(near.At(0.1, 0.5), 0.95);
  EXPECT_EQ(near.At(0.3, 0.5), 1);
  EXPECT_EQ(near.At(0.9, 0.5), 1);
}

TEST(SurfaceProjection, NormalMapsOfTheSourceAreExpressedInTheFramesOfTheTarget) {
  const SampleModel model = SampleModels(8, 96).back();
  ASSERT_TRUE(model.materials[0].is_normal);
  const MeshFile before = Opened(model.Glb());
  OutputOptions output;
  output.path = "out.glb";
  output.format = MeshFormat::kGlb;
  SurfaceProjectionOptions options;
  options.size = 384;
  const absl::StatusOr<ProjectedMesh> projected = ProjectSurface(before, WithNewMap(before), output, options);
  ASSERT_TRUE(projected.ok()) << projected.status();
  EXPECT_LE(CompareModels(before, Opened(projected->written.files.back().bytes), 4000).normal_mean_degrees, 2);
}

}  // namespace
}  // namespace planish
