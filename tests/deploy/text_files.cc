#include "tests/deploy/text_files.h"

#include <regex>

#include "gtest/gtest.h"

namespace planish::deploy {

std::string ReadSource(const std::string& path) {
  return ReadFile(std::string(PLANISH_SOURCE_TREE) + "/" + path);
}

std::set<std::string> FlagsOf(const std::string& program) {
  const Outcome help = RunShell(program + " --help");
  EXPECT_EQ(help.exit_code, 0) << program;
  std::set<std::string> flags;
  for (const std::string& line : Lines(help.out)) {
    if (!line.starts_with("  -")) continue;
    flags.merge(FlagsIn(line.substr(0, line.find("  ", 2))));  // "-o, --output OUT", without the text beside it
  }
  return flags;
}

std::set<std::string> FlagsIn(const std::string& text) {
  static const std::regex flag(R"((^|[\s"'\[,(`])(--[a-z][a-z0-9-]*))");
  std::set<std::string> flags;
  for (std::sregex_iterator it(text.begin(), text.end(), flag), end; it != end; ++it) flags.insert((*it)[2]);
  return flags;
}

}  // namespace planish::deploy
