// planish_texture_transfer [--detail=N] [--texels=N] [--points=N]: how much the looks of textured models change when
// they get a map of planish's own: colours through the old map and image against the new ones, at random points of the
// surface, in 255ths; of noise, letters and JPEG beside a resampler of 64 samples a texel; normals in degrees. Exit code
// 1 if a limit is not kept: 2 in the mean and 12 at the 99th percentile of smooth content, a tenth more than the
// reference of other content, 2 degrees.
#include <cstdio>
#include <string>

#include "CLI/CLI.hpp"
#include "tests/texture/sample_models.h"

int main(int argc, char** argv) {
  using namespace planish;
  CLI::App app("Measures how textured models look with a new map");
  int detail = 64, texels = 512, points = 100000;
  app.add_option("--detail", detail, "Squares a side of a patch [64]");
  app.add_option("--texels", texels, "Of a side of the images [512]");
  app.add_option("--points", points, "Of the surface [100000]");
  CLI11_PARSE(app, argc, argv);
  bool is_good = true;
  std::printf("| model | triangles | materials | mean | 99 %% | reference | 99 %% | normals |\n|---|---|---|---|---|---|---|---|\n");
  for (const SampleModel& model : SampleModels(detail, texels)) {
    const MeshFile before = Opened(model.Glb());
    const MeshFile after = WithNewMap(before);
    const ModelDifference difference = CompareModels(before, after, points);
    std::string other = " | ", normals;
    bool holds = difference.color.mean <= 2 && difference.color.percentile99 <= 12;
    if (model.materials[0].is_normal) {
      holds = difference.normal_mean_degrees <= 2;
      normals = std::to_string(difference.normal_mean_degrees).substr(0, 4);
    } else if (!model.is_smooth) {
      const Difference reference = ReferenceDifference(before, after, points);
      char text[64];
      std::snprintf(text, sizeof text, "%.2f | %.2f", reference.mean, reference.percentile99);
      other = text;
      holds = difference.color.mean <= 1.1 * reference.mean;
    }
    std::printf("| %s%s | %lld | %zu | %.2f | %.2f | %s | %s |\n", model.name.c_str(), holds ? "" : " **fails**",
                static_cast<long long>(before.mesh.num_polygons()), model.materials.size(), difference.color.mean,
                difference.color.percentile99, other.c_str(), normals.c_str());
    std::fflush(stdout);
    is_good &= holds;
  }
  return is_good ? 0 : 1;
}
