// `planish unwrap --atlas-per`, `--atlas-layout` and `--weight` as people use them.
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/e2e/command.h"
#include "tests/e2e/meshes.h"

namespace planish::testing {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A strip of four squares: object `body` has the groups `front` and `back`, object `lid` the last square. Two
// materials, and the last square has none.
constexpr char kStrip[] =
    "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nv 3 1 0\nv 4 1 0\n"
    "o lid\nf 4 5 10 9\n"
    "o body\ng front\nusemtl skin\nf 1 2 7 6\nf 2 3 8 7\ng back\nusemtl unused\nusemtl cloth\nf 3 4 9 8\n";

class AtlasTest : public CommandTest {
 protected:
  // The report of an unwrap of `input` with these flags, which must be usable.
  json Unwrapped(const std::string& input, std::vector<std::string> flags) {
    flags.insert(flags.begin(), {"unwrap", input, "-o", directory_.Path("out.obj"), "--json"});
    const Outcome run = Planish(flags);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    said_ = run.err;
    return json::parse(run.out);
  }

  // The UDIM tile of each face of the output, none where a face lies in several.
  std::vector<int> Tiles() {
    std::istringstream lines(ReadFile(directory_.Path("out.obj")));
    std::vector<std::pair<double, double>> uv;
    std::vector<int> tiles;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string word;
      words >> word;
      if (word == "vt") {
        double u = 0, v = 0;
        words >> u >> v;
        uv.emplace_back(u, v);
      }
      if (word != "f") continue;
      std::set<int> own;
      while (words >> word) {
        const auto& [u, v] = uv.at(std::stoul(word.substr(word.find('/') + 1)) - 1);
        own.insert(1001 + static_cast<int>(u) + 10 * static_cast<int>(v));
      }
      tiles.push_back(own.size() == 1 ? *own.begin() : 0);
    }
    return tiles;
  }

  static std::vector<std::string> Names(const json& report) {
    std::vector<std::string> names;
    for (const json& atlas : report["atlas"]["atlases"]) names.push_back(atlas["name"]);
    return names;
  }
  std::string said_;  // on stderr
};

TEST_F(AtlasTest, EachPartGetsATileOfItsOwn) {
  const std::string input = File("in.obj", kStrip);
  json report = Unwrapped(input, {"--atlas-per=group"});
  EXPECT_THAT(Names(report), ElementsAre("lid", "body front", "body back"));
  EXPECT_THAT(Tiles(), ElementsAre(1001, 1002, 1002, 1003));
  EXPECT_EQ(report["atlas"]["layout"], "udim");
  EXPECT_EQ(report["atlas"]["tiles"], 3);
  EXPECT_EQ(report["atlas"]["atlases"][1]["udim"], 1002);
  EXPECT_EQ(report["atlas"]["atlases"][1]["triangles"], 4);
  EXPECT_EQ(report["atlas"]["atlases"][0]["texels_per_unit"], report["atlas"]["atlases"][1]["texels_per_unit"]);
  EXPECT_THAT(said_, HasSubstr("Atlas body front: tile 1002, 1 chart, "));

  report = Unwrapped(input, {"--atlas-per=mesh"});
  EXPECT_THAT(Names(report), ElementsAre("lid", "body"));
  EXPECT_THAT(Tiles(), ElementsAre(1001, 1002, 1002, 1002));

  report = Unwrapped(input, {"--atlas-per=material"});
  EXPECT_THAT(Names(report), ElementsAre("skin", "cloth", "none")) << "only those that faces have";
  EXPECT_THAT(Tiles(), ElementsAre(1003, 1001, 1001, 1002));

  report = Unwrapped(input, {});
  EXPECT_FALSE(report["atlas"].contains("atlases"));
  EXPECT_THAT(Tiles(), ElementsAre(1001, 1001, 1001, 1001));
}

TEST_F(AtlasTest, StackedAtlasesFillTexturesOfTheirOwn) {
  const json report = Unwrapped(File("in.obj", kStrip), {"--atlas-per=group", "--atlas-layout=stacked"});
  EXPECT_THAT(Tiles(), ElementsAre(1001, 1001, 1001, 1001));
  const json& atlases = report["atlas"]["atlases"];
  EXPECT_GT(atlases[0]["texels_per_unit"].get<double>(), 1.5 * atlases[1]["texels_per_unit"].get<double>());
  EXPECT_EQ(report["quality"]["overlapping"], 0);
  EXPECT_THAT(said_, HasSubstr("Packed into 3 atlases of their own"));
}

TEST_F(AtlasTest, WeightsAreThoseOfPack) {
  const std::string input = File("in.obj", kStrip);
  const json plain = Unwrapped(input, {"--seams=auto,materials"});
  const json report = Unwrapped(input, {"--weight=skin=4"});
  EXPECT_EQ(report["chart_totals"]["charts"], 2) << "charts end between weights";
  EXPECT_LT(report["atlas"]["texels_per_unit"].get<double>(), 0.6 * plain["atlas"]["texels_per_unit"].get<double>())
      << "of those that make room";
  const Outcome unknown = Planish({"unwrap", input, "-o", directory_.Path("out.obj"), "--weight=skn=2"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("has no such material; it has cloth, skin, unused"));
}

TEST_F(AtlasTest, FilesAreOneJobWithAnAtlasEach) {
  const std::string a = File("a.obj", GridObj(6)), b = File("b.obj", GridObj(4, 1)), out = directory_.Path("done");
  std::filesystem::create_directory(out);
  const Outcome run = Planish({"unwrap", a, b, "-o", out, "--atlas-per=file", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_THAT(Names(report), ElementsAre("a.obj", "b.obj"));
  EXPECT_EQ(report["input"]["triangles"], 104);
  std::filesystem::copy_file(out + "/b.obj", directory_.Path("out.obj"));
  EXPECT_THAT(Tiles(), ::testing::Each(1002));
}

TEST_F(AtlasTest, SaysWhatAFileLacksOrHasTooManyOf) {
  const auto refused = [&](const std::string& input, const std::string& flag) {
    const Outcome run = Planish({"unwrap", input, "-o", directory_.Path("out.obj"), flag});
    EXPECT_EQ(run.exit_code, 2) << run.err;
    return run.err;
  };
  const std::string plain = File("plain.obj", GridObj(3));
  EXPECT_THAT(refused(plain, "--atlas-per=group"), HasSubstr("plain.obj has no objects or groups"));
  EXPECT_THAT(refused(plain, "--atlas-per=mesh"), HasSubstr("has no objects, which are an OBJ's meshes"));
  EXPECT_THAT(refused(plain, "--atlas-per=material"), HasSubstr("has no materials"));
  std::string many = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < 101; ++i) {
    const std::string x = std::to_string(2 * i);
    many += "v " + x + " 0 1\nv " + x + " 1 1\nv " + x + " 0 2\ng g" + std::to_string(i) + "\nf -3 -2 -1\n";
  }
  const std::string crowd = File("many.obj", many);
  EXPECT_THAT(refused(crowd, "--atlas-per=group"), HasSubstr("makes 101 atlases, which take 101 tiles; UDIM has 100"));
  EXPECT_EQ(Names(Unwrapped(crowd, {"--atlas-per=group", "--atlas-layout=stacked"})).size(), 101u);
}

TEST_F(AtlasTest, ABatchKnowsThatOtherAtlasesAreOtherWork) {
  const std::string a = File("a.obj", kStrip), b = File("b.obj", kStrip), out = directory_.Path("done");
  const auto kept = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> words = {"unwrap", a, b, "-o", out, "--json"};
    words.insert(words.end(), flags.begin(), flags.end());
    const Outcome run = Planish(words);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out.substr(run.out.rfind('\n', run.out.size() - 2) + 1))["summary"]["kept"].get<int>();
  };
  EXPECT_EQ(kept({}), 0);
  EXPECT_EQ(kept({"--atlas-per=group"}), 0);
  EXPECT_EQ(kept({"--atlas-per=group"}), 2);
  EXPECT_EQ(kept({"--atlas-per=group", "--atlas-layout=stacked"}), 0);
  EXPECT_EQ(kept({"--atlas-per=group", "--atlas-layout=stacked", "--weight=skin=2"}), 0);
}

}  // namespace
}  // namespace planish::testing
