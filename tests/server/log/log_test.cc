#include "server/log/log.h"

#include <unistd.h>

#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "server/log/line_format.h"
#include "server/log/output_lines.h"

namespace planish {
namespace {

using ::testing::ElementsAre;

const LogTime kTime = LogTime(std::chrono::milliseconds(1'700'000'000'042));

TEST(LogTest, JsonLineHasTimeLevelMessageAndFields) {
  EXPECT_EQ(JsonLine(kTime, "info", "QUEUED",
                     {{"job", "jobs/1"}, {"tenant", ""}, {"mesh_bytes", 12}, {"ran", 0.5}, {"on", true}}),
            R"({"time":"2023-11-14T22:13:20.042Z","level":"info","message":"QUEUED","job":"jobs/1","mesh_bytes":12,)"
            R"("ran":0.5,"on":true})");
}

TEST(LogTest, JsonLineIsValidWhateverTheTextsHold) {
  const std::string line = JsonLine(kTime, "info", "a\nb\x80", {{"label", "\xff\"\x1b[1m"}, {"x", std::nan("")}});
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(line);
  EXPECT_EQ(json["message"], "a\nb\xef\xbf\xbd");
  EXPECT_EQ(json["label"], "\xef\xbf\xbd\"\x1b[1m");
  EXPECT_TRUE(json["x"].is_null());
}

TEST(LogTest, HumanTextPutsTheJobInFrontAndEscapes) {
  EXPECT_EQ(HumanText("FAILED", {{"job", "jobs/1"}, {"reason", "X"}, {"error", "no \"mesh\"\n"}, {"n", 3}}),
            R"(jobs/1 FAILED reason=X error="no \"mesh\"\n" n=3)");
  EXPECT_EQ(HumanText("two\nlines \"of\" \x1b[1m", {}), R"(two\nlines "of" \033[1m)");
}

TEST(LogTest, LinesGoToStderrInTheChosenFormat) {
  ::testing::internal::CaptureStderr();
  SetUpLog(LogFormat::kJson, LogLevel::kInfo);
  LogInfo("first", {{"job", "jobs/1"}});
  LogDebug("not this");
  SetUpLog(LogFormat::kHuman, LogLevel::kWarn);
  LogInfo("nor this");
  LogWarn("second", {{"job", "jobs/2"}});
  const std::string text = ::testing::internal::GetCapturedStderr();
  const std::size_t end = text.find('\n');
  EXPECT_EQ(nlohmann::json::parse(text.substr(0, end))["job"], "jobs/1");
  EXPECT_THAT(text.substr(end + 1), ::testing::MatchesRegex("[-0-9T:.+]+ warning jobs/2 second\n"));
}

TEST(OutputLinesTest, SplitsWhatProcessesWrite) {
  std::vector<std::string> lines;
  {
    OutputLines output([&lines](const std::string& line) { lines.push_back(line); });
    const std::string text = "one\n\ntwo\n" + std::string(5000, 'x') + "\nend";
    ASSERT_EQ(write(output.write_fd(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::string joined;
  for (const std::string& line : lines) {
    EXPECT_LE(line.size(), 8192u);
    joined += line;
  }
  ASSERT_GE(lines.size(), 4u);
  EXPECT_EQ(lines[0], "one");
  EXPECT_EQ(lines[1], "two");
  EXPECT_EQ(lines.back(), "end");
  EXPECT_EQ(joined, "onetwo" + std::string(5000, 'x') + "end");
}

}  // namespace
}  // namespace planish
