// `planish pack` and `--preview` as people use them.
#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/e2e/command.h"
#include "tests/e2e/meshes.h"

namespace planish::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// Two squares; the second is twice as large on the surface and has the UV of the first, mirrored.
constexpr char kTwoIslands[] =
    "# mine\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 0 0\nv 7 0 0\nv 7 2 0\nv 5 2 0\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3 4/4\nf 5/1 6/4 7/3 8/2\n";

class PackTest : public CommandTest {};

TEST_F(PackTest, NeedsNoServerAndSaysWhatItDid) {
  const std::string output = directory_.Path("out.obj");
  const Outcome run = Planish({"pack", File("in.obj", kTwoIslands), "-o", output, "--json", "--padding=6",
                               "--texture-size=512", "--preview", directory_.Path("layout.svg")},
                              {{"PLANISHD", "/nonexistent"}, {"PLANISH_SERVER", "127.0.0.1:1"}});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, StartsWith("Packed 2 islands (1 mirrored) in "));
  EXPECT_THAT(run.err, HasSubstr("6 texels between islands"));
  const json report = json::parse(run.out);
  EXPECT_EQ(report["islands"], 2);
  EXPECT_EQ(report["mirrored"], 1);
  EXPECT_EQ(report["density"], "equal");
  EXPECT_EQ(report["output"], output);
  EXPECT_EQ(report["atlas"]["padding_kept"], 6.0);
  EXPECT_EQ(report["atlas"]["tiles"], 1);
  EXPECT_GT(report["atlas"]["texels_per_unit"].get<double>(), 100);
  EXPECT_GT(report["packing_efficiency"].get<double>(), 0.4);
  EXPECT_EQ(report["warnings"], json::array());
  const std::string text = ReadFile(output);
  EXPECT_THAT(text, StartsWith("# mine\nv 0 0 0\n"));
  EXPECT_THAT(text, HasSubstr("\nf 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7 8/8\n"));
  EXPECT_THAT(ReadFile(directory_.Path("layout.svg")), HasSubstr(">2 charts, 4 triangles<"));

  // What is packed packs to the same again, but for rounding: as many texels per unit.
  const Outcome again =
      Planish({"pack", output, "-o", directory_.Path("again.obj"), "--json", "--padding=6", "--texture-size=512"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_NEAR(json::parse(again.out)["atlas"]["texels_per_unit"].get<double>() /
                  report["atlas"]["texels_per_unit"].get<double>(),
              1, 0.05);
}

TEST_F(PackTest, MaterialsHaveWeights) {
  std::string text = kTwoIslands;
  text.insert(text.find("f 5/1"), "usemtl skin\n");
  const std::string input = File("in.obj", text);
  const auto texels = [&](const std::string& weight) {
    const Outcome run = Planish({"pack", input, "-o", directory_.Path("out.obj"), "--json", "--weight=" + weight});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out)["atlas"]["texels_per_unit"].get<double>();
  };
  EXPECT_LT(texels("skin=8"), 0.5 * texels("skin=1")) << "the other island makes room";
  const Outcome unknown = Planish({"pack", input, "-o", directory_.Path("out.obj"), "--weight=skn=2"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("has no such material; it has a, skin"));
}

TEST_F(PackTest, EveryFormatThatHoldsUv) {
  const std::string input = File("in.obj", kTwoIslands);
  for (const char* name : {"a.glb", "a.gltf", "a.ply", "a.off", "a.drc"}) {
    const Outcome there = Planish({"pack", input, "-o", directory_.Path(name), "--density=keep"});
    ASSERT_EQ(there.exit_code, 0) << name << there.err;
    const Outcome back = Planish({"pack", directory_.Path(name), "-o", directory_.Path("back.obj"), "--json"});
    ASSERT_EQ(back.exit_code, 0) << name << back.err;
    EXPECT_EQ(json::parse(back.out)["islands"], 2) << name;
    EXPECT_EQ(json::parse(back.out)["mirrored"], 1) << name;
  }
}

TEST_F(PackTest, RefusesWhatHasNoUvWithItsPlace) {
  const Outcome none = Planish({"pack", File("none.obj", GridObj(3)), "-o", directory_.Path("x.obj"), "--json"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("none.obj has no UV"));
  EXPECT_EQ(json::parse(none.out)["error"]["reason"], "UV_MISSING");

  const std::string part = std::string(kTwoIslands) + "f 1 3 6\nf 2/1 3/1 6/1\nf 1 4 5\n";
  const Outcome some = Planish({"pack", File("part.obj", part), "-o", directory_.Path("x.obj")});
  EXPECT_EQ(some.exit_code, 1);
  EXPECT_THAT(some.err, HasSubstr("2 faces have no UV [UV_MISSING]"));
  EXPECT_THAT(some.err, HasSubstr("face 2 (part.obj:17), face 4 (part.obj:19)"));

  const std::string wild = "v 0 0 0\nv 1 0 0\nv 0 1 nan\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
  const Outcome nan = Planish({"pack", File("nan.obj", wild), "-o", directory_.Path("x.obj")});
  EXPECT_EQ(nan.exit_code, 1);
  EXPECT_THAT(nan.err, HasSubstr("MESH_POSITION_NOT_FINITE"));
  EXPECT_FALSE(std::filesystem::exists(directory_.Path("x.obj")));

  EXPECT_EQ(Planish({"pack", directory_.Path("missing.obj"), "-o", directory_.Path("x.obj")}).exit_code, 2);
  const Outcome stl = Planish({"pack", File("in.obj", kTwoIslands), "-o", directory_.Path("x.stl")});
  EXPECT_EQ(stl.exit_code, 2) << stl.err;
}

TEST_F(PackTest, PaddingThatCannotBeKeptIsSaid) {
  std::string soup;
  for (int i = 0; i < 400; ++i) {
    const std::string x = std::to_string(i), first = std::to_string(3 * i + 1), second = std::to_string(3 * i + 2),
                      third = std::to_string(3 * i + 3);
    soup += "v " + x + " 0 0\nv " + x + " 1 0\nv " + x + " 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf " + first + "/" + first +
            " " + second + "/" + second + " " + third + "/" + third + "\n";
  }
  const Outcome run = Planish(
      {"pack", File("soup.obj", soup), "-o", directory_.Path("x.obj"), "--texture-size=64", "--padding=16", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_LT(report["atlas"]["padding_kept"].get<double>(), 16);
  ASSERT_EQ(report["warnings"].size(), 1u);
  EXPECT_EQ(report["warnings"][0]["reason"], "PADDING_REDUCED");
}

TEST_F(PackTest, UnwrapDrawsAPreview) {
  const std::string grid = File("grid.obj", GridObj(8));
  const Outcome run = Planish({"unwrap", grid, "-o", directory_.Path("a.obj"), "--preview", directory_.Path("a.png")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(ReadFile(directory_.Path("a.png")), StartsWith("\x89PNG"));
  ASSERT_EQ(
      Planish({"unwrap", grid, "-o", directory_.Path("a.obj"), "--pack=off", "--preview", directory_.Path("a.svg")})
          .exit_code,
      0);
  EXPECT_THAT(ReadFile(directory_.Path("a.svg")), HasSubstr(">1 chart, 128 triangles<"));
  const Outcome nowhere =
      Planish({"unwrap", grid, "-o", directory_.Path("b.obj"), "--preview", directory_.Path("missing/a.png")});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("FILE_UNWRITABLE"));
  EXPECT_FALSE(std::filesystem::exists(directory_.Path("b.obj"))) << "it fails before the solve";
}

}  // namespace
}  // namespace planish::testing
