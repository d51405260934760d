// `--seams=uv` on real meshes with an artist's UV: exactly their islands.
#include <filesystem>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/e2e/command.h"
#include "tests/testing/files.h"

namespace planish::testing {
namespace {

TEST(IslandsTest, BordersOfSharedMeshesAreKept) {
  const std::filesystem::path meshes = PLANISH_SHARED_MESHES;
  const std::vector<TableRow> rows = ReadTable(meshes / "MANIFEST.tsv");
  if (rows.empty()) GTEST_SKIP() << "no shared meshes at " << meshes;
  int count = 0;
  const TempDir directory;
  for (const TableRow& row : rows) {
    if (row.at("group") != "g") continue;
    const std::string& file = row.at("file");
    const Outcome run =
        Planish({"unwrap", meshes / file, "-o", directory.Path(file), "--seams=uv", "--json", "--progress=none"});
    ASSERT_EQ(run.exit_code, 0) << file << "\n" << run.err;
    const nlohmann::json report = nlohmann::json::parse(run.out);
    EXPECT_EQ(report["chart_totals"]["charts"], std::stoi(row.at("uv_charts"))) << file;
    EXPECT_EQ(report["quality"]["flipped"], 0) << file;
    EXPECT_EQ(report["quality"]["overlapping"], 0) << file;
    for (const nlohmann::json& warning : report["warnings"]) EXPECT_NE(warning["reason"], "SEAMS_ADDED") << file;
    ++count;
  }
  EXPECT_EQ(count, 7);
}

}  // namespace
}  // namespace planish::testing
