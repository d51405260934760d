#include "tests/deploy/text_files.h"

#include <sys/wait.h>

#include <cstdio>
#include <fstream>
#include <regex>
#include <sstream>

#include "gtest/gtest.h"

namespace planish::deploy {

std::string ReadFile(const std::string& path) {
  std::ifstream file(path);
  EXPECT_TRUE(file.is_open()) << path;
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string ReadSource(const std::string& path) {
  return ReadFile(std::string(PLANISH_SOURCE_TREE) + "/" + path);
}

Printed RunShell(const std::string& command) {
  Printed printed;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return printed;
  char buffer[4096];
  for (std::size_t size; (size = fread(buffer, 1, sizeof buffer, pipe)) > 0;) printed.out.append(buffer, size);
  const int status = pclose(pipe);
  printed.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return printed;
}

std::set<std::string> FlagsOf(const std::string& program) {
  const Printed help = RunShell(program + " --help");
  EXPECT_EQ(help.exit_code, 0) << program;
  std::set<std::string> flags;
  std::istringstream lines(help.out);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  -")) continue;
    const std::string names = line.substr(2, line.find(' ', 2) - 2);
    flags.merge(FlagsIn(std::regex_replace(names, std::regex(","), " ")));
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
