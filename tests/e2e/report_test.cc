// `planish report` and `unwrap --report`: that a page is written, and what is in it. tests/report opens pages.
#include <algorithm>
#include <string>
#include <vector>

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

class ReportTest : public CommandTest {
 protected:
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
}

TEST_F(ReportTest, EveryChartHasTheResidualOfEveryStep) {
  const std::string a = File("a.obj", GridObj(6)), b = File("b.obj", GridObj(4, 1)),
                    page = directory_.Path("page.html");
  const Outcome run = Planish({"unwrap", a, b, "-o", directory_.Path(""), "--one-atlas", "--report", page});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json unwrap = Page(ReadFile(page))["unwrap"];
  ASSERT_GE(unwrap["charts"].size(), 2);
  std::size_t most = 0;
  for (const json& chart : unwrap["charts"]) {
    EXPECT_EQ(chart["steps"].size(), chart["newton_iterations"].get<std::size_t>() + 1);
    EXPECT_EQ(chart["steps"].back(), chart["residual"]);
    EXPECT_LE(chart["residual"], unwrap["tolerance"]);
    most = std::max(most, chart["steps"].size());
  }
  EXPECT_EQ(unwrap["largest"].size(), most);
  EXPECT_EQ(unwrap["tolerance"], 1e-9);
}

TEST_F(ReportTest, ManyFilesAreASheetWithAPageEach) {
  const std::string a = File("a.obj", kTriangle), b = File("b.obj", kTriangle);
  const std::string bare = File("bare.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Outcome run = Report({a, b, bare, directory_.Path("none.obj"), "-o", directory_.Path("sheet.html")});
  EXPECT_EQ(run.exit_code, 2) << run.err;
  EXPECT_THAT(run.err, HasSubstr("sheet.html: 4 files, 2 without a page"));
  const json sheet = json::parse(Script(ReadFile(directory_.Path("sheet.html")), "planish-sheet"));
  ASSERT_EQ(sheet["rows"].size(), 4);
  EXPECT_EQ(sheet["rows"][0]["name"], "a.obj");
  EXPECT_EQ(sheet["rows"][0]["page"], "sheet_files/a.obj.html");
  EXPECT_EQ(sheet["rows"][0]["result"], "shown");
  EXPECT_EQ(sheet["rows"][0]["charts"], 1);
  EXPECT_EQ(sheet["rows"][0]["efficiency"], 0.5);
  EXPECT_TRUE(sheet["rows"][0].contains("picture"));
  EXPECT_FALSE(sheet["rows"][0].contains("seconds"));
  EXPECT_EQ(sheet["rows"][2]["result"], "failed");
  EXPECT_THAT(sheet["rows"][2]["message"], HasSubstr("has no UV to show"));
  EXPECT_FALSE(sheet["rows"][2].contains("page"));
  EXPECT_THAT(sheet["rows"][3]["message"], HasSubstr("none.obj: cannot open"));
  EXPECT_EQ(Page(ReadFile(directory_.Path("sheet_files/a.obj.html")))["sheet"], "../sheet.html");

  // Two files into a directory are no comparison; a directory is searched.
  EXPECT_EQ(Report({a, b, "-o", directory_.Path("two/")}).exit_code, 0);
  EXPECT_EQ(json::parse(Script(ReadFile(directory_.Path("two/index.html")), "planish-sheet"))["rows"].size(), 2);
  EXPECT_EQ(Page(ReadFile(directory_.Path("two/b.obj.html")))["sheet"], "index.html");
  EXPECT_EQ(Report({a, directory_.Path("none"), "-o", "-"}).exit_code, 2);
  EXPECT_EQ(Report({directory_.Path(""), "-o", directory_.Path("all/")}).exit_code, 1) << "bare.obj has no UV";
  EXPECT_EQ(json::parse(Script(ReadFile(directory_.Path("all/index.html")), "planish-sheet"))["rows"].size(), 3);
}

TEST_F(ReportTest, ABatchHasASheet) {
  const std::string a = File("a.obj", kTriangle), bad = File("bad.obj", "v 0 0 zero\n");
  const std::string sheet = directory_.Path("sheet");
  const std::vector<std::string> command = {"unwrap", a, bad, "-o", directory_.Path("out/"), "--report", sheet};
  EXPECT_EQ(Planish(command).exit_code, 1);
  const auto rows = [&] { return json::parse(Script(ReadFile(sheet + "/index.html"), "planish-sheet"))["rows"]; };
  const json first = rows();
  ASSERT_EQ(first.size(), 2);
  EXPECT_EQ(first[0]["result"], "usable");
  EXPECT_EQ(first[0]["page"], "a.obj.html");
  EXPECT_EQ(first[0]["warnings"], 0);
  EXPECT_GE(first[0]["seconds"], 0);
  EXPECT_EQ(first[1]["result"], "failed");
  EXPECT_FALSE(first[1].contains("page"));
  const std::string page = ReadFile(sheet + "/a.obj.html");
  EXPECT_EQ(Page(page)["unwrap"]["charts"].size(), 1);
  EXPECT_EQ(Page(page)["maps"].size(), 2) << "before and after";
  EXPECT_EQ(Page(page)["sheet"], "index.html");

  // What is up to date keeps its page; one that is gone, or of another result, is made of the output.
  EXPECT_EQ(Planish(command).exit_code, 1);
  EXPECT_EQ(rows(), first);
  EXPECT_EQ(ReadFile(sheet + "/a.obj.html"), page);
  PutFile(sheet + "/a.obj.html", "something else");
  EXPECT_EQ(Planish(command).exit_code, 1);
  EXPECT_EQ(rows()[0]["efficiency"], first[0]["efficiency"]);
  EXPECT_EQ(Page(ReadFile(sheet + "/a.obj.html"))["maps"].size(), 1);

  const Outcome detached = Planish(
      {"unwrap", a, bad, "-o", directory_.Path("out/"), "--report", sheet, "--detach", "--server", "127.0.0.1:1"});
  EXPECT_EQ(detached.exit_code, 2);
  EXPECT_THAT(detached.err, HasSubstr("--report goes with the run that fetches them"));
}

}  // namespace
}  // namespace planish::testing
