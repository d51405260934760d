#include "server/config/settings.h"

#include <filesystem>

#include "CLI/CLI.hpp"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/config/near_name.h"
#include "server/config/settings_file.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// A program with a few options, configured from three places.
class SettingsTest : public ::testing::Test {
 protected:
  struct Program {
    CLI::App app;
    int queue = 64;
    double hours = 24;
    bool isolated = true;
    bool verbose = false;
    std::string directory;
    std::vector<std::string> listen = {"a", "b"};
    int secret = 0;
    std::unique_ptr<Settings> settings;

    Program() {
      app.add_option("--queue", queue)->capture_default_str()->check(CLI::Range(0, 100));
      app.add_option("--retain-hours", hours)->check(CLI::Range(1.0, 100.0));
      app.add_option("--isolation", isolated)
          ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"process", true}, {"thread", false}}))
          ->default_str("process");
      app.add_flag("--verbose", verbose);
      app.add_option("--directory", directory);
      app.add_option("--listen", listen)
          ->capture_default_str()
          ->check([](const std::string& text) { return text == "bad" ? "no such place" : ""; })
          ->allow_extra_args(false);
      app.add_option("--secret", secret)->configurable(false);
      settings = std::make_unique<Settings>(&app, "TEST_");
    }
  };

  std::string Write(const std::string& text) {
    PutFile(dir_.Path("f.yaml"), text);
    return dir_.Path("f.yaml");
  }

  // All errors, the path of the file cut off.
  std::vector<std::string> Configure(std::vector<std::string> flags, const Environment& environment,
                                     const std::string& file) {
    program_ = std::make_unique<Program>();
    std::reverse(flags.begin(), flags.end());
    program_->app.parse(flags);
    std::vector<std::string> errors = program_->settings->AddEnvironment(environment);
    const std::string path = Write(file);
    for (const std::string& error : program_->settings->AddFile(path)) {
      EXPECT_EQ(error.rfind(path, 0), 0u) << error;
      errors.push_back(error.substr(path.size() - 6));
    }
    return errors;
  }

  std::string Source(const std::string& key) {
    for (const Setting& setting : program_->settings->InEffect()) {
      if (setting.key == key)
        return ValueText(setting) + " " + std::filesystem::path(setting.source).filename().string();
    }
    return "?";
  }

  TempDir dir_;
  std::unique_ptr<Program> program_;
};

TEST_F(SettingsTest, FlagsOverEnvironmentOverFile) {
  const std::string file = "queue: 1\nretain-hours: 2.5\nisolation: thread\nverbose: true\nlisten: [x, y]\n";
  const Environment environment = {{"TEST_QUEUE", "2"}, {"TEST_RETAIN_HOURS", "3"}, {"TEST_DIRECTORY", ""}};
  EXPECT_THAT(Configure({"--queue=3"}, environment, file), IsEmpty());
  EXPECT_EQ(program_->queue, 3);
  EXPECT_EQ(program_->hours, 3);
  EXPECT_FALSE(program_->isolated);
  EXPECT_TRUE(program_->verbose);
  EXPECT_THAT(program_->listen, ElementsAre("x", "y"));
  EXPECT_EQ(Source("queue"), "3 flag");
  EXPECT_EQ(Source("retain-hours"), "3 environment");
  EXPECT_EQ(Source("isolation"), "thread f.yaml:3");
  EXPECT_EQ(Source("verbose"), "true f.yaml:4");
  EXPECT_EQ(Source("listen"), "[x, y] f.yaml:5");
  EXPECT_EQ(Source("directory"), "none default");
  EXPECT_EQ(Source("secret"), "?");
}

TEST_F(SettingsTest, DefaultsAreInEffectUnlessGiven) {
  EXPECT_THAT(Configure({}, {}, ""), IsEmpty());
  EXPECT_EQ(Source("queue"), "64 default");
  EXPECT_EQ(Source("retain-hours"), "24 default");
  EXPECT_EQ(Source("isolation"), "process default");
  EXPECT_EQ(Source("verbose"), "false default");
  EXPECT_EQ(Source("listen"), "[a, b] default");
}

TEST_F(SettingsTest, ListsComeFromAVariableWithCommas) {
  EXPECT_THAT(Configure({}, {{"TEST_LISTEN", "x, y"}}, "listen: z\n"), IsEmpty());
  EXPECT_THAT(program_->listen, ElementsAre("x", "y"));
}

TEST_F(SettingsTest, ErrorsNameFileLineAndKey) {
  const std::string file =
      "queue: -3\n"
      "quue: 4\n"
      "isolation: perhaps\n"
      "retain-hours: [1, 2]\n"
      "directory:\n"
      "listen:\n"
      "- good\n"
      "- bad\n"
      "verbose: {a: b}\n"
      "secret: 1\n"
      "queue: 5\n";
  EXPECT_THAT(Configure({}, {}, file),
              ElementsAre("f.yaml:5: directory: has no value", "f.yaml:9: verbose: takes a value, not keys of its own",
                          "f.yaml:11: queue: is there a second time, after line 1",
                          "f.yaml:1: queue: Value -3 not in range 0 to 100",
                          "f.yaml:2: quue: there is no such setting; did you mean queue?",
                          ::testing::StartsWith("f.yaml:3: isolation: Check perhaps"),
                          "f.yaml:4: retain-hours: takes one value, not a list", "f.yaml:8: listen: no such place",
                          "f.yaml:10: secret: is for the command line only"));
}

TEST_F(SettingsTest, WhatIsOverriddenMustBeRightAllTheSame) {
  EXPECT_THAT(Configure({"--queue=3", "--listen=x"}, {}, "listen: [good, bad]\nqueue: 101\n"),
              ElementsAre("f.yaml:1: listen: no such place", "f.yaml:2: queue: Value 101 not in range 0 to 100"));
  EXPECT_EQ(program_->queue, 3);
  EXPECT_EQ(Source("listen"), "[x] flag");
}

TEST_F(SettingsTest, ErrorsOfTheEnvironmentNameTheVariable) {
  EXPECT_THAT(Configure({}, {{"TEST_QUEUE", "many"}}, ""), ElementsAre("TEST_QUEUE: Value many not in range 0 to 100"));
}

TEST_F(SettingsTest, UnknownVariablesAreNamed) {
  Configure({}, {}, "");
  const Environment environment = {
      {"TEST_QUEU", "1"}, {"TEST_OTHER_THING", "1"}, {"TEST_CONFIG", "1"}, {"HOME", "/"}, {"TEST_LISTEN", "x"}};
  EXPECT_THAT(program_->settings->UnknownVariables(environment, {"TEST_CONFIG"}),
              ElementsAre("TEST_OTHER_THING: there is no such setting",
                          "TEST_QUEU: there is no such setting; did you mean TEST_QUEUE?"));
}

TEST_F(SettingsTest, YamlOfSettingsGivesTheSameSettings) {
  Configure({"--directory=/tmp/a: b # c", "--isolation=thread", "--listen=127.0.0.1:1", "--listen=\"q\", r"}, {}, "");
  const std::vector<Setting> before = program_->settings->InEffect();
  const std::string yaml = ToYaml(before);
  EXPECT_THAT(Configure({}, {}, yaml), IsEmpty()) << yaml;
  const std::vector<Setting> after = program_->settings->InEffect();
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(after[i].values, before[i].values) << after[i].key;
  EXPECT_EQ(program_->directory, "/tmp/a: b # c");
}

TEST_F(SettingsTest, FilesThatAreNone) {
  EXPECT_THAT(ReadSettingsFile(dir_.Path("gone")).errors,
              ElementsAre(dir_.Path("gone") + ": cannot read it: No such file or directory"));
  const auto errors = [this](const std::string& text) { return ReadSettingsFile(Write(text)).errors; };
  const std::string path = dir_.Path("f.yaml");
  EXPECT_THAT(errors("a: [b\n"), ElementsAre(::testing::StartsWith(path + ":2: this is no YAML: ")));
  EXPECT_THAT(errors("- a\n- b\n"), ElementsAre(path + ":1: the file should have \"key: value\" on each line"));
  EXPECT_THAT(errors("a: 1\n---\nb: 2\n"), ElementsAre(path + ": holds more than one YAML document"));
  EXPECT_THAT(errors("# nothing\n"), IsEmpty());
  EXPECT_THAT(errors(std::string(2 << 20, '#')), ElementsAre(path + ": is larger than 1048576 bytes"));
}

TEST(NearNameTest, FewChangesForTheLength) {
  const std::vector<std::string> names = {"queue", "queue-total", "max-mesh-mb"};
  EXPECT_EQ(NearName("qeue", names), "queue");
  EXPECT_EQ(NearName("MAX_MESH_MB", names), "max-mesh-mb");
  EXPECT_EQ(NearName("queue-totl", names), "queue-total");
  EXPECT_EQ(NearName("colour", names), "");
}

}  // namespace
}  // namespace planish
