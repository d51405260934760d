// Models look the same with another map. `tests/bench/run.sh textures` does it with larger images and more points.
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

}  // namespace
}  // namespace planish
