#include "client/cli/report_command.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <optional>
#include <vector>

#include "client/cli/batch_plan.h"
#include "client/cli/batch_table.h"
#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_images.h"
#include "client/cli/report_page.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/files/file_io.h"
#include "client/src/errors.h"

namespace planish::cli {
namespace {

constexpr char kReportHelp[] = R"(Examples:
  planish report hero.glb -o hero.html
  planish report hero_blender.obj hero_planish.obj -o compare.html   with the same camera
  planish unwrap hero.glb -o flat.glb --report=hero.html   before, after, and the solve
  planish report props/ hero.glb -o sheet/                 a contact sheet, and a page per file
  planish unwrap props/ -o done/ --report=sheet.html       the same for a batch

The page is one file, opened from disk; it loads nothing from the network. It shows the surface and the layout, linked
by hovering and clicking, with checker, charts, stretch, angle error, seams, colours or textures; a table of charts; and
warnings, with links to the triangles that they are about. It needs a browser with WebGL 2.

More than two files, a directory, or a directory after -o make a contact sheet: an index with a small picture and the
key figures of each file, which can be sorted, and a page for each file. -o DIR writes the index to DIR/index.html and
the pages beside it (DIR/props/a.obj.html); -o FILE.html writes the index to FILE.html and the pages to FILE_files.
unwrap --report does the same for a batch, and lists files that failed. Exit codes: 0 written, 1 a file has no UV, 2 bad
usage or an unreadable file.)";

}  // namespace

void AddFlags(CLI::App& app, ReportArguments& arguments) {
  app.footer(kReportHelp);
  app.add_option("A", arguments.inputs.first, "Mesh file with UV, as for unwrap")->required()->type_name("");
  app.add_option("B", arguments.inputs.more,
                 "A second file, to compare with A; or further files and directories, for a sheet")
      ->type_name("");
  app.add_option("-o,--output", arguments.output, "Output page; - is stdout; a directory makes a sheet")
      ->type_name("HTML|DIR");
  app.add_option("--job-report", arguments.job_report,
                 "Output of unwrap --json about the last file, to show its methods of charts, times and warnings")
      ->type_name("JSON");
  AddTileSize(app, arguments.tiles.texture_size);
  app.add_option_function<int>(
         "--padding", [&arguments](const int& texels) { arguments.tiles.padding = texels; },
         "Texels wanted between charts, up to 64: drawn around each chart, with a warning if charts are nearer [2]")
      ->check(CLI::Range(0, 64).description(""))
      ->type_name("N");
  AddTiles(app, arguments.tiles.tiles);
  app.add_option("--texcoord", arguments.texcoord, "Show the UV set TEXCOORD_N of a glTF, N up to 63 [0]")
      ->check(CLI::Range(0, kLargestTexcoord).description(""))
      ->type_name("N");
}

namespace {

// Whether the command makes a sheet, with a page for each file, instead of a single page.
bool IsSheet(const ReportArguments& arguments) {
  const std::vector<std::string> inputs = arguments.inputs.All();
  return inputs.size() > 2 || IsDirectory(arguments.output) || arguments.output.ends_with('/') ||
         std::any_of(inputs.begin(), inputs.end(), IsDirectory);
}

// Checks the arguments for a sheet.
std::string CheckSheet(const ReportArguments& arguments) {
  if (arguments.output == "-") return "-o - takes one page; those of many files need -o DIRECTORY/";
  if (!arguments.job_report.empty()) return "--job-report is about one file, and -o about many";
  const std::vector<std::string> inputs = arguments.inputs.All();
  if (std::count(inputs.begin(), inputs.end(), "-") > 0) {
    return "- (standard input) is one mesh, and cannot be one of many";
  }
  return "";
}

std::string CheckPlace(const ReportArguments& arguments) {
  if (!arguments.output.empty()) return "";
  return "where should the page go? planish report " + arguments.inputs.first + " -o report.html";
}

}  // namespace

std::string Check(ReportArguments& arguments) {
  arguments.sheet = IsSheet(arguments);
  return FirstProblem({CheckStreams(arguments.inputs.All()),
                       arguments.sheet ? "" : CheckTexcoord(arguments.texcoord, arguments.inputs.first),
                       CheckPlace(arguments), arguments.sheet ? CheckSheet(arguments) : ""});
}

namespace {

namespace fs = std::filesystem;

// Reads what `unwrap --json` printed. Throws planish::Error.
Json ReadJobReport(const std::string& path) {
  const absl::StatusOr<std::string> text = ReadWholeFile(path);
  if (!text.ok()) throw ErrorFrom(text.status());
  Json json = Json::parse(*text, nullptr, false);
  if (!json.is_object() || !json.contains("quality")) {
    throw Error(ErrorCode::kInvalidArgument, "FILE_MALFORMED",
                path + ": this is not what planish unwrap --json prints about one mesh");
  }
  return json;
}

int ReportOne(const ReportArguments& arguments, const Execution& execution) {
  std::optional<Json> job_report;
  if (!arguments.job_report.empty()) job_report = ReadJobReport(arguments.job_report);
  if (arguments.output != "-") CheckOutput(arguments.output);
  const MapCheckOptions options = CheckOptionsOf(arguments.tiles);
  const double padding = arguments.tiles.padding;
  const MeshInput first({arguments.inputs.first}, arguments.texcoord);
  const CheckedMap first_map = CheckMapOf(first, options, execution);
  if (!execution.IsCancelled()) RequireUv(first, first_map);
  std::optional<MeshInput> second;
  CheckedMap second_map;
  int second_texcoord = 0;
  if (!arguments.inputs.more.empty()) {
    const std::string& path = arguments.inputs.more.front();
    const bool is_gltf = FormatOfPath(path) == MeshFormat::kGltf || FormatOfPath(path) == MeshFormat::kGlb;
    if (is_gltf) second_texcoord = arguments.texcoord;
    second.emplace(std::vector<std::string>{path}, second_texcoord);
    second_map = CheckMapOf(*second, options, execution);
    if (!execution.IsCancelled()) RequireUv(*second, second_map);
  }
  if (execution.IsCancelled()) return kInterrupted;
  std::string name = fs::path(arguments.inputs.first).filename().string();
  std::string second_name = second ? fs::path(second->path()).filename().string() : "";
  if (name == second_name) name += " (A)", second_name += " (B)";
  ReportImages images;
  std::vector<ReportedMap> maps = {
      {name, first, first_map, options, padding, images.Of(first, first_map, arguments.texcoord)}};
  if (second) {
    maps.push_back(
        {second_name, *second, second_map, options, padding, images.Of(*second, second_map, second_texcoord)});
  }
  WriteOutput(arguments.output, ReportPage(maps, &images, job_report).html);
  return kOk;
}

int ReportMany(const ReportArguments& arguments, const Execution& execution) {
  const ReportSheet sheet(arguments.output);
  const BatchPlan plan = PlanBatch({arguments.inputs.All(), sheet.pages().string(), "", arguments.texcoord});
  std::cerr << SkippedText(plan);
  sheet.Prepare();
  std::vector<SheetRow> rows;
  std::int64_t failed = 0, unreadable = 0;
  for (const BatchItem& item : plan.items) {
    SheetRow& row = rows.emplace_back();
    row.name = item.name;
    row.result = ToString(BatchResult::kNotTried);
    if (execution.IsCancelled()) continue;
    try {
      if (item.problem) throw *item.problem;
      const SheetPageJob job = {sheet, ReportSheet::PageOf(item.name), "", ""};
      row.card = WriteFilePage(job, MeshInput({item.input}, item.texcoord), item.texcoord, arguments.tiles, execution);
      if (row.card.is_null()) continue;
      row.page = job.page;
      row.result = "shown";
    } catch (const Error& error) {
      row.result = ToString(BatchResult::kFailed);
      row.message = error.what();
      ++(error.reason() == "UV_MISSING" ? failed : unreadable);
      std::cerr << ErrorText(error, Places(error.metadata()), StderrTerminal());
    }
  }
  sheet.Write(rows);
  std::cerr << sheet.index().string() << ": " << Counted(static_cast<std::int64_t>(rows.size()), "file", "files")
            << (failed + unreadable == 0 ? "" : ", " + WithCommas(failed + unreadable) + " without a page") << "\n";
  return unreadable > 0 ? kUsage : failed > 0 ? kFailed : kOk;
}

}  // namespace

int Run(const ReportArguments& arguments, Interrupts& interrupts) {
  int exit_code = kOk;
  const bool is_interrupted = IsInterruptedIn(interrupts, [&](const Execution& execution) {
    exit_code = arguments.sheet ? ReportMany(arguments, execution) : ReportOne(arguments, execution);
  });
  if (is_interrupted) {
    std::cerr << "planish: interrupted; " << (arguments.sheet ? "the sheet has what was done" : "nothing was written")
              << "\n";
    return kInterrupted;
  }
  return exit_code;
}

}  // namespace planish::cli
