// planish_polygon_hunt [--first=N] [--seeds=N] [--size=N] [--out=DIR] [FAMILY...]: unwraps random polygon meshes
// (tests/testing/polygon_families.h), writes each in one of five formats, and judges the bytes
// (tests/client/polygon_promises.h). A line for each broken promise, and the OBJ in DIR. Exit code 1 if there is any.
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "tests/client/polygon_promises.h"
#include "tests/testing/dice.h"
#include "tests/testing/polygon_families.h"

namespace planish::bench {
namespace {

int Hunt(const std::vector<std::string>& families, int first, int seeds, int most, bool for_texture,
         const std::string& out) {
  const std::pair<MeshFormat, const char*> formats[] = {{MeshFormat::kObj, "obj"},
                                                        {MeshFormat::kPly, "ply"},
                                                        {MeshFormat::kOff, "off"},
                                                        {MeshFormat::kGlb, "glb"},
                                                        {MeshFormat::kDraco, "drc"}};
  int cases = 0, broken = 0;
  for (int seed = first; seed < first + seeds; ++seed) {
    for (const std::string& family : families) {
      testing::Dice dice(static_cast<std::uint64_t>(seed));
      const int size = 2 + dice.Below(most - 1);
      const auto& [format, name] = formats[dice.Below(5)];
      const std::string obj = testing::ObjText(testing::MakePolygons(family, static_cast<std::uint64_t>(seed), size));
      ++cases;
      const std::vector<std::string> found = testing::BrokenPolygonPromises(obj, format, for_texture);
      if (found.empty()) continue;
      ++broken;
      for (const std::string& each : found) {
        std::printf("%s:%d:%d as %s: %s\n", family.c_str(), seed, size, name, each.c_str());
      }
      std::fflush(stdout);
      if (!out.empty()) std::ofstream(out + "/" + family + "_" + std::to_string(seed) + ".obj") << obj;
    }
  }
  std::printf("%d cases, %d broken\n", cases, broken);
  return broken == 0 ? 0 : 1;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  CLI::App app("Unwraps random polygon meshes and judges the bytes that are written");
  int first = 1, seeds = 100, size = 100;
  std::string out, prefer = "seams";
  std::vector<std::string> families;
  app.add_option("--first", first, "the first seed");
  app.add_option("--seeds", seeds, "seeds of each family");
  app.add_option("--size", size, "polygons at most, about")->check(CLI::Range(2, 100000));
  app.add_option("--prefer", prefer, "seams or texture")->check(CLI::IsMember({"seams", "texture"}));
  app.add_option("--out", out, "directory for meshes with a broken promise");
  app.add_option("FAMILY", families, "of tests/testing/polygon_families.h [all]");
  CLI11_PARSE(app, argc, argv);
  if (families.empty()) families = planish::testing::PolygonFamilies();
  return planish::bench::Hunt(families, first, seeds, size, prefer == "texture", out);
}
