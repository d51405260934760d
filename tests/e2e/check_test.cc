// `planish check` as pipelines use it.
#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/e2e/command.h"

namespace planish::testing {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Two squares side by side in the map; the second one mirrored.
constexpr char kTwoCharts[] =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 6 1 0\nv 5 1 0\n"
    "vt 0 0\nvt .4 0\nvt .4 .4\nvt 0 .4\nvt .5 0\nvt .9 0\nvt .9 .4\nvt .5 .4\n"
    "f 1/1 2/2 3/3 4/4\nf 5/6 6/5 7/8 8/7\n";
constexpr char kNoUv[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

class CheckTest : public CommandTest {
 protected:
  // There is no server to ask.
  static Outcome Check(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "check");
    return Planish(arguments, {{"PLANISHD", "/nonexistent"}, {"PLANISH_SERVER", "127.0.0.1:1"}});
  }
};

TEST_F(CheckTest, SaysWhatThereIsAndRequiresNothingUnasked) {
  const Outcome run = Check({File("in.obj", kTwoCharts)});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("in.obj: 4 triangles, 2 charts in 1 tile of 1,024 x 1,024 texels\n"),
                             HasSubstr("\n  mirrored charts     1, with 2 triangles; first chart 1 (from face 1)\n"),
                             HasSubstr("\n  packing efficiency  32.0 %\n")));
}

TEST_F(CheckTest, RequirementsDecideTheExitCode) {
  const std::string file = File("in.obj", kTwoCharts);
  EXPECT_EQ(Check({file, "--require=uv,no-overlap,no-flip,no-degenerate,in-tile", "--min-padding=64"}).exit_code, 0);
  const Outcome run = Check({file, "--require=all", "--json"});
  EXPECT_EQ(run.exit_code, 1);
  const json report = json::parse(run.out);
  EXPECT_EQ(report["ok"], false);
  EXPECT_EQ(report["mirrored"]["charts"], 1);
  EXPECT_EQ(report["flipped"]["count"], 0);
  EXPECT_EQ(report["mirrored"]["first"][0]["first_face"], 1);
  for (const json& requirement : report["requirements"]) {
    EXPECT_EQ(requirement["met"].get<bool>(), requirement["name"] != "no-mirror") << requirement;
  }
  EXPECT_EQ(Check({file, "--max-stretch=1.01"}).exit_code, 0);
  EXPECT_EQ(Check({file, "--texture-size=64", "--min-padding=6.3"}).exit_code, 0);  // a tenth of the tile is 6.4
  EXPECT_EQ(Check({file, "--texture-size=64", "--min-padding=6.5"}).exit_code, 1);
}

TEST_F(CheckTest, FilesWithoutUvAreNotAsRequired) {
  const Outcome run = Check({File("in.obj", kNoUv)});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, HasSubstr("NOT MET: uv: there are no UV"));
}

TEST_F(CheckTest, SeveralFilesHaveALineEach) {
  const Outcome run = Check({File("a.obj", kTwoCharts), File("b.obj", kNoUv), directory_.Path("none.obj"), "--json"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("none.obj"));
  const std::vector<std::string> lines = Lines(run.out);
  ASSERT_THAT(lines, SizeIs(4));
  EXPECT_EQ(json::parse(lines[0])["ok"], true);
  EXPECT_EQ(json::parse(lines[1])["ok"], false);
  EXPECT_EQ(json::parse(lines[2])["error"]["reason"], "FILE_UNREADABLE");
  const json summary = json::parse(lines[3])["summary"];
  EXPECT_EQ(summary, json({{"files", 3}, {"maps", 2}, {"failed", 1}, {"unreadable", 1}}));
  EXPECT_EQ(Check({directory_.Path("a.obj"), directory_.Path("b.obj")}).exit_code, 1);
}

TEST_F(CheckTest, BadUsage) {
  const std::string file = File("in.obj", kTwoCharts);
  EXPECT_EQ(Check({}).exit_code, 2);
  const Outcome unknown = Check({file, "--require=beauty"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("there is no requirement \"beauty\""));
  EXPECT_EQ(Check({file, "--texcoord=64"}).exit_code, 2);
  EXPECT_EQ(Check({file, "--texcoord=1"}).exit_code, 2);  // an OBJ has one set
  EXPECT_EQ(Check({file, "--max-stretch=0.5"}).exit_code, 2);
}

// Triangle 0 with TEXCOORD_0 of no area, and TEXCOORD_1 of half a tile.
TEST_F(CheckTest, SetsOfUvAreJudgedOneByOne) {
  const std::string file = File(
      "in.gltf",
      R"({"asset":{"version":"2.0"},
    "buffers":[{"byteLength":84,"uri":"data:application/octet-stream;base64,)"
      "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAgD8AAIA/AACAPwAAAAAAAAAA"
      R"("}],
    "bufferViews":[{"buffer":0,"byteLength":84}],
    "accessors":[
      {"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
      {"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC2"},
      {"bufferView":0,"byteOffset":60,"componentType":5126,"count":3,"type":"VEC2"}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1,"TEXCOORD_1":2}}]}]})");
  const Outcome first = Check({file});
  EXPECT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr("The file has TEXCOORD_1 too"));
  EXPECT_EQ(Check({file, "--require=no-degenerate"}).exit_code, 1);
  EXPECT_EQ(Check({file, "--require=no-degenerate", "--texcoord=1"}).exit_code, 0);
  const Outcome all = Check({file, "--require=no-degenerate", "--texcoord=all", "--json"});
  EXPECT_EQ(all.exit_code, 1);
  const std::vector<std::string> lines = Lines(all.out);
  ASSERT_THAT(lines, SizeIs(3));
  EXPECT_EQ(json::parse(lines[0])["uv_sets"], json({0, 1}));
  EXPECT_EQ(json::parse(lines[0])["ok"], false);
  EXPECT_EQ(json::parse(lines[1])["uv_set"], 1);
  EXPECT_EQ(json::parse(lines[1])["ok"], true);
  EXPECT_EQ(Check({file, "--texcoord=2"}).exit_code, 1);  // there is none
}

}  // namespace
}  // namespace planish::testing
