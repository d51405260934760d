// `planish report` and `unwrap --report`: that a page is written, and what is in it. tests/report opens pages.
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/e2e/command.h"
#include "tests/e2e/meshes.h"

namespace planish::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr char kTriangle[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\no </script>\nf 1/1 2/2 3/3\n";

class ReportTest : public ::testing::Test {
 protected:
  std::string File(const std::string& name, const std::string& text) {
    PutFile(directory_.Path(name), text);
    return directory_.Path(name);
  }
  static Outcome Report(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "report");
    return Planish(arguments, {{"PLANISHD", "/nonexistent"}, {"PLANISH_SERVER", "127.0.0.1:1"}});
  }
  static std::string Script(const std::string& page, const std::string& id) {
    const std::string head = "id=\"" + id + "\">";
    const std::size_t begin = page.find(head);
    if (begin == std::string::npos) return "";
    return page.substr(begin + head.size(), page.find("</script>", begin) - begin - head.size());
  }
  static json Page(const std::string& page) { return json::parse(Script(page, "planish-page")); }

  TempDir directory_;
};

TEST_F(ReportTest, WritesAPageAndAsksNoServer) {
  const Outcome run = Report({File("<script>.obj", kTriangle), "-o", directory_.Path("page.html")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string page = ReadFile(directory_.Path("page.html"));
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  const json data = Page(page);
  ASSERT_EQ(data["maps"].size(), 1);
  EXPECT_EQ(data["maps"][0]["name"], "<script>.obj");
  EXPECT_EQ(data["maps"][0]["triangles"], 1);
  EXPECT_EQ(data["maps"][0]["places"], 3);
  EXPECT_FALSE(data.contains("unwrap"));
  EXPECT_THAT(Script(page, "planish-map-0"), Not(""));
  EXPECT_LT(page.size(), 1'000'000u);
  const Outcome to_stdout = Report({directory_.Path("<script>.obj"), "-o", "-"});
  EXPECT_EQ(to_stdout.out, page);
}

TEST_F(ReportTest, ComparesTwoFiles) {
  const std::string a = File("a.obj", kTriangle), b = File("b.obj", std::string(kTriangle) + "f 1/1 3/3 2/2\n");
  ASSERT_EQ(Report({a, b, "-o", directory_.Path("page.html")}).exit_code, 0);
  const json data = Page(ReadFile(directory_.Path("page.html")));
  ASSERT_EQ(data["maps"].size(), 2);
  EXPECT_EQ(data["maps"][0]["name"], "a.obj");
  EXPECT_EQ(data["maps"][1]["triangles"], 2);
  EXPECT_EQ(data["maps"][0]["findings"].size(), 0);
  EXPECT_EQ(data["maps"][1]["findings"][0]["kind"], "overlap");
}

TEST_F(ReportTest, SaysWhatItCannotShow) {
  const std::string a = File("a.obj", kTriangle), bare = File("bare.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string page = directory_.Path("page.html");
  const Outcome run = Report({bare, "-o", page});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("has no UV to show"));
  EXPECT_EQ(Report({a}).exit_code, 2);
  EXPECT_EQ(Report({a, a, a, "-o", page}).exit_code, 2);
  EXPECT_EQ(Report({directory_.Path("none.obj"), "-o", page}).exit_code, 2);
  const Outcome job_report = Report({a, "-o", page, "--job-report", a});
  EXPECT_EQ(job_report.exit_code, 2);
  EXPECT_THAT(job_report.err, HasSubstr("not what planish unwrap --json prints"));
  EXPECT_EQ(Report({a, "-o", directory_.Path("none/page.html")}).exit_code, 2);
}

TEST_F(ReportTest, UnwrapTellsHowItWasSolved) {
  const std::string mesh = File("in.obj", kTriangle), page = directory_.Path("page.html");
  const Outcome run = Planish({"unwrap", mesh, "-o", directory_.Path("out.obj"), "--json", "--report", page});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json data = Page(ReadFile(page));
  ASSERT_EQ(data["maps"].size(), 2);
  EXPECT_EQ(data["maps"][0]["name"], "before");
  EXPECT_EQ(data["maps"][1]["name"], "after");
  EXPECT_EQ(data["unwrap"]["charts"].size(), 1);
  EXPECT_TRUE(data["unwrap"]["seconds"].contains("solve"));
  EXPECT_EQ(data["maps"][1]["findings"].size(), 0);

  // The same from the JSON that unwrap printed.
  const std::string printed = File("job.json", run.out);
  ASSERT_EQ(Report({directory_.Path("out.obj"), "-o", page, "--job-report", printed}).exit_code, 0);
  EXPECT_EQ(Page(ReadFile(page))["unwrap"]["charts"], data["unwrap"]["charts"]);
  EXPECT_EQ(Planish({"unwrap", mesh, mesh, "-o", directory_.Path("out/"), "--report", page}).exit_code, 2);
}

}  // namespace
}  // namespace planish::testing
