#include "tests/house/source_tree.h"

#include <algorithm>
#include <regex>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish::house {
namespace {

using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

constexpr std::size_t kMaxLines = 600;

const std::set<std::string> kCode = {".cc", ".h", ".proto", ".cmake", ".sh", ".mjs", ".py", "CMakeLists.txt"};

TEST(SourceTree, TopLevelIsFixed) {
  EXPECT_THAT(TopLevel(Root()),
              UnorderedElementsAre(".ci", ".clang-format", ".clang-tidy", ".dockerignore", ".editorconfig", ".github",
                                   ".gitignore", "CHANGELOG.md", "CMakeLists.txt", "CMakePresets.json", "Dockerfile",
                                   "LICENSE", "README.md", "client", "core", "deploy", "proto", "server", "tests"));
}

TEST(SourceTree, NoFileIsTooLong) {
  std::vector<std::string> too_long;
  for (const SourceFile& file : ReadSources(Root(), kCode)) {
    const std::size_t lines = Lines(file.text).size();
    if (lines > kMaxLines) too_long.push_back(file.path + ": " + std::to_string(lines) + " lines");
  }
  EXPECT_THAT(too_long, IsEmpty()) << "split them: no file has more than " << kMaxLines << " lines";
}

TEST(SourceTree, ScriptsMayBeRun) {
  std::vector<std::string> wrong;
  for (const SourceFile& file : ReadSources(Root(), {".sh", ".py"})) {
    const auto mode = std::filesystem::status(Root() / file.path).permissions();
    const bool runs = (mode & std::filesystem::perms::owner_exec) != std::filesystem::perms::none;
    if (file.text.starts_with("#!") != runs) wrong.push_back(file.path);
  }
  EXPECT_THAT(wrong, IsEmpty()) << "a script has a first line #! and may be executed (chmod +x), or neither";
}

// A comment directly above each call says what it does, which codes it returns and what the client should do.
TEST(SourceTree, EveryCallInTheProtoIsDocumented) {
  const std::regex rpc(R"(^\s*rpc\s+(\w+).*)");
  const std::regex comment(R"(^\s*//\s*\S.*)");
  std::vector<std::string> calls;
  std::vector<std::string> undocumented;
  for (const SourceFile& file : ReadSources(Root(), {".proto"})) {
    const std::vector<std::string> lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      std::smatch match;
      if (!std::regex_match(lines[i], match, rpc)) continue;
      calls.push_back(match[1]);
      const bool is_test_fixture = file.path.starts_with("tests/");
      if (!is_test_fixture && (i == 0 || !std::regex_match(lines[i - 1], comment))) {
        undocumented.push_back(file.path + ": " + match[1].str());
      }
    }
  }
  EXPECT_THAT(calls, IsSupersetOf({"Unwrap", "WatchJob"}));
  EXPECT_THAT(undocumented, IsEmpty());
}

// The core is a library: what it has to say is in its results. Also catches debugging aids that were left behind.
TEST(SourceTree, CoreNeitherPrintsNorReadsTheEnvironment) {
  const std::regex use(R"(.*(\b(printf|puts|putchar|getenv)\s*\(|\bfprintf\s*\(\s*std|std::(cout|cerr|clog)\b).*)");
  EXPECT_TRUE(std::regex_match("  if (getenv(\"DEBUG\")) {", use));
  EXPECT_FALSE(std::regex_match("std::snprintf(buffer, sizeof buffer, \"%d\", 1);", use));
  std::vector<std::string> found;
  for (const SourceFile& file : ReadSources(Root(), {".cc", ".h"})) {
    if (!file.path.starts_with("core/")) continue;
    const std::vector<std::string> lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (std::regex_match(lines[i], use)) found.push_back(file.path + ":" + std::to_string(i + 1) + ": " + lines[i]);
    }
  }
  EXPECT_THAT(found, IsEmpty());
}

// The library compiles on any system but for the private server.
TEST(SourceTree, OnlyThePrivateServerIsBoundToLinux) {
  const std::regex use(
      R"(.*(memfd|pidfd|signalfd|eventfd|timerfd|epoll|inotify|\bSYS_|\bsyscall|posix_spawn|/proc/).*)");
  EXPECT_TRUE(std::regex_match("  fd = memfd_create(name, 0);", use));
  std::size_t files = 0;
  std::vector<std::string> found;
  for (const SourceFile& file : ReadSources(Root(), {".cc", ".h"})) {
    if (!file.path.starts_with("client/src/") && !file.path.starts_with("client/include/")) continue;
    ++files;
    if (file.path == "client/src/private_server.cc") continue;
    for (const std::string& line : Lines(file.text)) {
      if (std::regex_match(line, use)) found.push_back(file.path + ": " + line);
    }
  }
  EXPECT_GT(files, 10u);
  EXPECT_THAT(found, IsEmpty());
}

TEST(SourceTree, ReadsWhatIsThere) {
  const std::vector<SourceFile> files = ReadSources(Root(), {"source_tree.h", ".nothing"});
  ASSERT_THAT(files, SizeIs(1));
  EXPECT_EQ(files[0].path, "tests/house/source_tree.h");
  EXPECT_THAT(Lines(files[0].text), SizeIs(std::count(files[0].text.begin(), files[0].text.end(), '\n')));
}

}  // namespace
}  // namespace planish::house
