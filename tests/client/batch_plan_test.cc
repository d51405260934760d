// What a batch is going to do, and what its results depend on.
#include "client/cli/batch_plan.h"

#include <unistd.h>

#include <filesystem>

#include "client/cli/unwrap_arguments.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

class BatchPlanTest : public ::testing::Test {
 protected:
  void SetUp() override { files_.output = (root_ / "out").string(); }

  std::string File(const std::string& name, const std::string& bytes = "x") const {
    fs::create_directories((root_ / name).parent_path());
    PutFile(root_ / name, bytes);
    return (root_ / name).string();
  }

  BatchPlan Plan(const std::vector<std::string>& inputs) {
    files_.inputs = inputs;
    return PlanBatch(files_);
  }

  // "name -> key" of every item.
  std::vector<std::string> Way(const std::vector<std::string>& inputs) {
    std::vector<std::string> way;
    for (const BatchItem& item : Plan(inputs).items) {
      way.push_back(item.name + " -> " + item.key);
      EXPECT_EQ(item.output, (root_ / "out" / item.key).string());
    }
    return way;
  }

  // Reason and message.
  std::string Refusal(const std::vector<std::string>& inputs) {
    try {
      Plan(inputs);
    } catch (const Error& error) {
      return error.reason() + " " + error.what();
    }
    return "";
  }

  const TempDir temporary_;
  const fs::path root_ = temporary_.Path();
  BatchFiles files_;
};

TEST_F(BatchPlanTest, WalksDirectoriesInOrderAndSaysWhatItSkipped) {
  File("in/b.obj");
  File("in/a/z.GLB");
  File("in/a/scan.stl");
  File("in/a/.b.obj");
  File("in/a/x.mtl");
  File("in/y.mtl");
  File("in/notes");
  File("in/.git/c.obj");
  File("in/out/old.obj");
  const std::string single = File("else/0.ply");
  fs::create_directory_symlink(root_ / "in", root_ / "in" / "round");
  files_.output = (root_ / "in" / "out").string();
  const BatchPlan plan = Plan({single, (root_ / "in").string() + "/"});
  std::vector<std::string> names;
  for (const BatchItem& item : plan.items) names.push_back(item.name + " -> " + item.key);
  EXPECT_THAT(names, ElementsAre("0.ply -> 0.ply", "a/scan.stl -> a/scan.obj", "a/z.GLB -> a/z.GLB", "b.obj -> b.obj"));
  EXPECT_EQ(plan.items[0].bytes, 1);
  EXPECT_THAT(plan.skipped, ElementsAre(Pair(".mtl", 2), Pair("hidden", 2), Pair("link to a directory", 1),
                                        Pair("output directory", 1), Pair("without extension", 1)));
  EXPECT_EQ(SkippedText(plan),
            "Skipped in directories: 2 .mtl, 2 hidden, 1 link to a directory, 1 output directory, 1 without "
            "extension.\n");
  EXPECT_EQ(SkippedText(BatchPlan()), "");
}

TEST_F(BatchPlanTest, OneFormatForAll) {
  files_.format = "glb";
  files_.texcoord = 1;
  const std::vector<std::string> files = {File("a.obj"), File("b.GLB"), File("c.x.gltf")};
  EXPECT_THAT(Way(files), ElementsAre("a.obj -> a.glb", "b.GLB -> b.GLB", "c.x.gltf -> c.x.glb"));
  const BatchPlan plan = Plan(files);
  EXPECT_EQ(plan.items[0].texcoord, 0) << "an OBJ has one set of UV";
  EXPECT_EQ(plan.items[1].texcoord, 1);
}

TEST_F(BatchPlanTest, WhatIsNoMeshFailsAlone) {
  const BatchPlan plan = Plan({File("a.obj"), File("b.txt"), (root_ / "missing.obj").string()});
  ASSERT_EQ(plan.items.size(), 3u);
  EXPECT_FALSE(plan.items[0].problem);
  ASSERT_TRUE(plan.items[1].problem);
  EXPECT_EQ(plan.items[1].problem->reason(), "FILE_FORMAT_UNKNOWN");
  EXPECT_FALSE(plan.items[2].problem) << "found out when it is its turn";
  const BatchPlan nowhere = Plan({File("a.obj"), (root_ / "missing").string() + "/"});
  ASSERT_EQ(nowhere.items.size(), 2u);
  EXPECT_EQ(nowhere.items[1].problem->reason(), "FILE_UNREADABLE");
}

TEST_F(BatchPlanTest, DirectoriesThatCannotBeReadAreNotPassedOver) {
  if (geteuid() == 0) GTEST_SKIP() << "root can read everything";
  File("in/a.obj");
  File("in/locked/b.obj");
  fs::permissions(root_ / "in/locked", fs::perms::none);
  const BatchPlan plan = Plan({(root_ / "in").string()});
  fs::permissions(root_ / "in/locked", fs::perms::all);
  ASSERT_EQ(plan.items.size(), 2u);
  EXPECT_TRUE(plan.items[0].problem);
}

TEST_F(BatchPlanTest, ConflictsAreRefusedBeforeAnythingRuns) {
  EXPECT_THAT(Refusal({File("a/x.obj"), File("b/x.obj")}), HasSubstr("BATCH_OUTPUT_CONFLICT "));
  EXPECT_THAT(Refusal({File("a/x.obj"), File("b/x.obj")}), HasSubstr("would both become"));
  EXPECT_THAT(Refusal({File("a/x.obj"), File("b/x.stl")}), HasSubstr("BATCH_OUTPUT_CONFLICT"));
  EXPECT_THAT(Refusal({File("a/x.obj"), (root_ / "a").string()}), HasSubstr("BATCH_OUTPUT_CONFLICT"));
  EXPECT_EQ(Refusal({File("a/x.obj"), File("b/x.ply")}), "");
  files_.output = (root_ / "a").string() + "/";
  EXPECT_THAT(Refusal({File("a/x.obj"), File("b/y.ply")}), HasSubstr("is an input as well"));
  files_.output = (root_ / "out").string();
  files_.format = "glb";
  files_.output = (root_ / "a").string();
  EXPECT_THAT(Refusal({(root_ / "a").string()}), HasSubstr("searched for inputs as well"));
  files_.format = "";
  files_.output = (root_ / "out").string();
  fs::create_directory(root_ / "empty");
  EXPECT_THAT(Refusal({(root_ / "empty").string()}), HasSubstr("BATCH_EMPTY"));
  files_.output = File("file");
  EXPECT_THAT(Refusal({File("a/x.obj")}), HasSubstr("BATCH_OUTPUT_UNSUPPORTED"));
}

TEST_F(BatchPlanTest, DigestsFollowContent) {
  const std::string a = File("a.obj", "v 0 0 0\n");
  const std::string digest = InputDigest(a);
  EXPECT_EQ(digest.size(), 64u);
  EXPECT_EQ(InputDigest(File("b.obj", "v 0 0 0\n")), digest) << "names do not matter";
  EXPECT_NE(InputDigest(File("a.obj", "v 0 0 1\n")), digest);
  EXPECT_THROW(InputDigest((root_ / "none.obj").string()), Error);

  const std::string gltf = File("m.gltf", R"({"buffers":[{"uri":"m%20x.bin"},{"uri":"data:,AA"}]})");
  const std::string without = InputDigest(gltf);
  File("m x.bin", "1");
  const std::string with = InputDigest(gltf);
  File("m x.bin", "2");
  EXPECT_NE(with, without);
  EXPECT_NE(InputDigest(gltf), with) << "its buffers are part of it";
}

TEST_F(BatchPlanTest, SettingsAreWhatChangesBytes) {
  UnwrapArguments arguments;
  const std::string plain = SettingsDigest(arguments);
  arguments.map.options.threads = 7;
  arguments.json = true;
  arguments.timeout_seconds = 3;
  EXPECT_EQ(SettingsDigest(arguments), plain);
  arguments.map.options.padding = 2;
  const std::string padded = SettingsDigest(arguments);
  EXPECT_NE(padded, plain);
  arguments.map.options.solver.hessian = Hessian::kExact;
  EXPECT_NE(SettingsDigest(arguments), padded);
  arguments.map.options = {};
  arguments.map.seams.uv = true;
  EXPECT_NE(SettingsDigest(arguments), plain);
}

}  // namespace
}  // namespace planish::cli
