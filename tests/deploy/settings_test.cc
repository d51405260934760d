// What files of deploy/ tell planishd, against what it understands.
#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/deploy/text_files.h"
#include "tests/deploy/yaml_files.h"

namespace planish::deploy {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;

std::set<std::string> ServerFlags() {
  static const std::set<std::string> flags = FlagsOf(PLANISHD_COMMAND);
  return flags;
}

// "--max-mesh-mb" for PLANISHD_MAX_MESH_MB.
std::string FlagOfVariable(std::string variable) {
  variable = variable.substr(std::string("PLANISHD_").size());
  std::transform(variable.begin(), variable.end(), variable.begin(), [](char c) {
    return c == '_' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  });
  return "--" + variable;
}

// Flags of the commands that begin with "planishd --", up to three blanks, and variables of planishd, anywhere in
// `text`.
std::set<std::string> UsedBy(const std::string& text) {
  std::set<std::string> used;
  const std::string lines = std::regex_replace(text, std::regex(R"(\\\n *)"), "");
  static const std::regex command(R"((^|[/ "`=])planishd"?,? +(--[^\n]*))");
  for (std::sregex_iterator it(lines.begin(), lines.end(), command), end; it != end; ++it) {
    const std::string flags = (*it)[2];
    used.merge(FlagsIn(flags.substr(0, flags.find("   "))));
  }
  static const std::regex variable(R"(\bPLANISHD_[A-Z_]+\b)");
  for (std::sregex_iterator it(text.begin(), text.end(), variable), end; it != end; ++it) {
    used.insert(FlagOfVariable(it->str()));
  }
  return used;
}

TEST(Settings, UsedByIsNotBlind) {
  EXPECT_EQ(
      UsedBy("ExecStart=planishd --a=1 --b\nplanish unwrap --c\n  planishd \\\n  --d   add --e\nplanishd under --f"),
      (std::set<std::string>{"--a", "--b", "--d"}));
  EXPECT_EQ(UsedBy("ENV PLANISHD_MAX_MESH_MB=1"), std::set<std::string>{"--max-mesh-mb"});
}

TEST(Settings, FlagsAndVariablesThatFilesUseExist) {
  std::map<std::string, std::string> texts;
  for (const std::string path : {"Dockerfile", "README.md", "server/README.md", "server/jobs/README.md",
                                 "server/store/README.md", "server/rpc/README.md", "server/metrics/README.md"})
    texts[path] = ReadSource(path);
  const std::filesystem::path root = PLANISH_SOURCE_TREE;
  for (const auto& file : std::filesystem::recursive_directory_iterator(root / "deploy")) {
    if (file.is_regular_file()) texts[file.path().lexically_relative(root)] = ReadFile(file.path());
  }
  int checked = 0;
  for (const auto& [path, text] : texts) {
    for (const std::string& flag : UsedBy(text)) {
      EXPECT_TRUE(ServerFlags().contains(flag)) << path << ": " << flag;
      ++checked;
    }
  }
  EXPECT_GE(checked, 15);
}

// Keys of files that are complete configurations, and arguments of containers.
TEST(Settings, KeysOfConfigurationFilesExist) {
  for (const std::string path : {"deploy/image.yaml", "deploy/kubernetes/overlays/single/planishd.yaml",
                                 "deploy/kubernetes/overlays/farm/front-planishd.yaml",
                                 "deploy/kubernetes/overlays/farm/worker-planishd.yaml"}) {
    const YAML::Node settings = YAML::Load(ReadSource(path));
    ASSERT_TRUE(settings.IsMap()) << path;
    for (const auto& setting : settings) {
      EXPECT_TRUE(ServerFlags().contains("--" + setting.first.as<std::string>())) << path << ": " << setting.first;
    }
  }
  for (const YAML::Node& object : ParseObjects(ReadSource("deploy/kubernetes/overlays/single/statefulset.yaml")).all) {
    for (const YAML::Node& argument : At(object, "/spec/template/spec/containers/0/args")) {
      EXPECT_THAT(FlagsIn(argument.as<std::string>()), ::testing::IsSubsetOf(ServerFlags()));
    }
  }
}

// deploy/planishd.yaml has every setting, as a comment.
TEST(Settings, TheSampleHasEveryKey) {
  const std::string text = ReadSource("deploy/planishd.yaml");
  EXPECT_FALSE(YAML::Load(text).IsMap()) << "all of it is comments, so it changes nothing";
  std::set<std::string> keys;
  std::ostringstream uncommented;
  std::istringstream lines(text);
  const std::regex setting(R"(^#([a-z][a-z0-9-]*): .*)");
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (!std::regex_match(line, match, setting)) continue;
    keys.insert("--" + match[1].str());
    uncommented << line.substr(1) << "\n";
  }
  EXPECT_TRUE(YAML::Load(uncommented.str()).IsMap()) << "and it is a configuration without the '#'";
  std::set<std::string> expected = ServerFlags();
  // What is no setting.
  for (const std::string flag :
       {"--help", "--version", "--generate", "--config", "--print-config", "--check-config", "--supervisor-fd"}) {
    expected.erase(flag);
  }
  EXPECT_EQ(keys, expected);
}

TEST(Settings, TheServerTakesTheConfigurationFiles) {
  if (!ServerFlags().contains("--check-config")) GTEST_SKIP() << "this planishd has no --check-config";
  const std::string sample = std::string(PLANISH_SOURCE_TREE) + "/deploy/planishd.yaml";
  EXPECT_EQ(RunShell(std::string(PLANISHD_COMMAND) + " --check-config --config=" + sample).exit_code, 0);
}

}  // namespace
}  // namespace planish::deploy
