// `--seams=uv` on real meshes with an artist's UV: exactly their islands.
#include <filesystem>
#include <fstream>
#include <sstream>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/e2e/command.h"

namespace planish::testing {
namespace {

TEST(IslandsTest, BordersOfSharedMeshesAreKept) {
  const std::filesystem::path meshes = PLANISH_SHARED_MESHES;
  std::ifstream table(meshes / "MANIFEST.tsv");
  if (!table) GTEST_SKIP() << "no shared meshes at " << meshes;
  const auto cells = [](const std::string& line) {
    std::vector<std::string> result;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, '\t');) result.push_back(cell);
    return result;
  };
  std::string line;
  std::getline(table, line);
  const std::vector<std::string> heading = cells(line);
  const auto column = [&](const char* name) {
    return std::find(heading.begin(), heading.end(), name) - heading.begin();
  };
  int count = 0;
  const TempDirectory directory;
  while (std::getline(table, line)) {
    const std::vector<std::string> row = cells(line);
    if (row[0] != "g") continue;
    const std::string& file = row[column("file")];
    const Outcome run =
        Planish({"unwrap", meshes / file, "-o", directory / file, "--seams=uv", "--json", "--progress=none"});
    ASSERT_EQ(run.exit_code, 0) << file << "\n" << run.err;
    const nlohmann::json report = nlohmann::json::parse(run.out);
    EXPECT_EQ(report["chart_totals"]["charts"], std::stoi(row[column("uv_charts")])) << file;
    EXPECT_EQ(report["quality"]["flipped"], 0) << file;
    EXPECT_EQ(report["quality"]["overlapping"], 0) << file;
    for (const nlohmann::json& warning : report["warnings"]) EXPECT_NE(warning["reason"], "SEAMS_ADDED") << file;
    ++count;
  }
  EXPECT_EQ(count, 7);
}

}  // namespace
}  // namespace planish::testing
