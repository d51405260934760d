// Man pages, made from what the programs say of themselves.
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/deploy/text_files.h"

namespace planish::deploy {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// Without what roff needs.
std::string Plain(std::string page) {
  page = std::regex_replace(page, std::regex(R"(\\-)"), "-");
  page = std::regex_replace(page, std::regex(R"(\\f[BIR]|\\&)"), "");
  return std::regex_replace(page, std::regex(R"(\\e)"), "\\");
}

std::string Page(const std::string& name) {
  return ReadFile(std::string(PLANISH_PAGES) + "/" + name);
}

std::vector<std::string> Subcommands(const std::string& program) {
  std::vector<std::string> found;
  std::istringstream lines(RunShell(program + " --help").out);
  bool here = false;
  for (std::string line, name; std::getline(lines, line);) {
    if (line.ends_with(':') && !line.starts_with(' ')) here = line == "Commands:";
    if (here && line.starts_with("  ") && line[2] != ' ') found.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return found;
}

// Every flag has a paragraph of its own, with a description, in the section of its subcommand.
void ExpectFlags(const std::string& program, const std::string& section) {
  const std::set<std::string> flags = FlagsOf(program);
  EXPECT_GE(flags.size(), 1u) << program;
  for (const std::string& flag : flags) {
    const std::regex paragraph("\\.TP\n(-[a-z], )?" + flag + "(,[^\n]*| [^\n]*)?\n\\S[^\n]+\n");
    EXPECT_TRUE(std::regex_search(section, paragraph)) << program << " " << flag;
  }
}

TEST(ManPages, HaveEveryFlagOfTheServer) {
  const std::string page = Plain(Page("planishd.8"));
  EXPECT_THAT(page, ::testing::StartsWith(".TH PLANISHD 8"));
  ExpectFlags(PLANISHD_COMMAND, page);
  EXPECT_THAT(page, Not(HasSubstr("INT:INT"))) << "limits are told as people would";
  EXPECT_THAT(page, HasSubstr("--sandbox auto|require|off\n"));
}

TEST(ManPages, HaveEveryFlagOfEveryCommand) {
  const std::string page = Plain(Page("planish.1"));
  ExpectFlags(PLANISH_COMMAND, page);
  int commands = 0;
  std::vector<std::pair<std::string, std::string>> waiting = {{PLANISH_COMMAND, "planish"}};
  while (!waiting.empty()) {
    const auto [program, title] = waiting.back();
    waiting.pop_back();
    for (const std::string& name : Subcommands(program)) {
      const std::string full = title + " " + name;
      const std::size_t begin = page.find("\n.SS " + full + "\n");
      ASSERT_NE(begin, std::string::npos) << full;
      const std::size_t end = page.find("\n.S", begin + 5);
      ExpectFlags(program + " " + name, page.substr(begin, end - begin) + "\n");
      waiting.emplace_back(program + " " + name, full);
      ++commands;
    }
  }
  EXPECT_GE(commands, 13);
}

TEST(Help, HasLinesOf100ColumnsAtMost) {
  std::vector<std::string> waiting = {PLANISH_COMMAND, PLANISHD_COMMAND};
  while (!waiting.empty()) {
    const std::string program = waiting.back();
    waiting.pop_back();
    for (const char* flag : {" -h", " --help"}) {
      std::istringstream lines(RunShell(program + flag).out);
      for (std::string line; std::getline(lines, line);)
        EXPECT_LE(line.size(), 100u) << program << flag << "\n" << line;
    }
    for (const std::string& name : Subcommands(program)) waiting.push_back(program + " " + name);
  }
}

TEST(ManPages, AreRightToMan) {
  if (RunShell("man --version >/dev/null 2>&1").exit_code != 0) GTEST_SKIP() << "man is not installed";
  for (const std::string page : {"planish.1", "planishd.8"}) {
    const Outcome shown =
        RunShell("LC_ALL=C.UTF-8 MANWIDTH=100 man --warnings -l " + std::string(PLANISH_PAGES) + "/" + page + " 2>&1");
    EXPECT_EQ(shown.exit_code, 0) << page;
    EXPECT_THAT(shown.out, HasSubstr("SEE ALSO")) << page;
    EXPECT_THAT(shown.out, Not(HasSubstr("warning:"))) << page;
  }
}

}  // namespace
}  // namespace planish::deploy
