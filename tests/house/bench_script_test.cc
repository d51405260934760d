// What tests/bench/run.sh can be asked without measuring anything.
#include <filesystem>
#include <regex>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/deploy/text_files.h"

namespace planish::deploy {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(BenchScript, AFolderWithoutMeasuringProgramsIsNamedWithTheSwitch) {
  const std::string build = ::testing::TempDir() + "/planish_bench_script";
  std::filesystem::create_directories(build);
  PutFile(build + "/CMakeCache.txt", "PLANISH_BUILD_BENCHMARKS:BOOL=OFF\n");
  const Outcome run = RunShell("'" PLANISH_SOURCE_TREE "/tests/bench/run.sh' textures --quick --build '" + build + "'");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("cmake -B " + build + " -DPLANISH_BUILD_BENCHMARKS=ON"));
}

// Without a name, ImageMagick looks for Helvetica, which no package of the list brings.
TEST(BenchScript, LabelsNameTheirFont) {
  const std::string script = std::regex_replace(ReadSource("tests/bench/run.sh"), std::regex(R"(\\\n\s*)"), "");
  const std::regex label(R"([^\n]*(montage|convert) [^\n]*(-label |label:)[^\n]*)");
  std::vector<std::string> nameless;
  int found = 0;
  for (std::sregex_iterator at(script.begin(), script.end(), label), end; at != end; ++at, ++found) {
    if (at->str().find("-font \"$font\"") == std::string::npos) nameless.push_back(at->str());
  }
  EXPECT_EQ(found, 2);
  EXPECT_THAT(nameless, IsEmpty());
}

}  // namespace
}  // namespace planish::deploy
