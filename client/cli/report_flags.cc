#include "client/cli/report_flags.h"

#include "CLI/CLI.hpp"
#include "client/cli/arguments.h"

namespace planish::cli {
namespace {

constexpr char kReportHelp[] = R"(Examples:
  planish report hero.glb -o hero.html
  planish report hero_blender.obj hero_planish.obj -o compare.html     one above the other, with the same camera
  planish unwrap hero.glb -o flat.glb --report=hero.html               the UV that came in, the new ones, and the solve

The page is one file, opened from disk; it asks the network for nothing. It shows the surface and the layout, linked by
hovering and clicking, with checker, charts, stretch, angle error, seams or colours; a table of charts; and warnings, which
lead to the triangles that they are about. It needs a browser with WebGL 2. Exit codes: 0 written, 1 a file has no UV, 2 bad
usage or an unreadable file.)";

}  // namespace

void DefineReport(CLI::App& app, Arguments& arguments) {
  CLI::App& report = *app.add_subcommand("report", "Write a page that shows the UV of a mesh, or of two side by side");
  report.parse_complete_callback([&arguments] { arguments.command = Command::kReport; });
  report.footer(kReportHelp);
  report.add_option("A", arguments.input, "Mesh file with UV, as for unwrap")->required()->type_name("");
  report.add_option("B", arguments.more_inputs, "A second one to compare with it")->type_name("");
  report.add_option("-o,--output", arguments.output, "Where the page goes; - is stdout")->type_name("HTML");
  report
      .add_option("--job-report", arguments.job_report,
                  "What unwrap --json printed about the last file: methods of charts, times, warnings")
      ->type_name("JSON");
  report.add_option("--texture-size", arguments.options.texture_size, "Texels per side of a tile, 16 to 65536 [1024]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  report
      .add_option_function<int>(
          "--padding", [&arguments](const int& texels) { arguments.options.padding = texels; },
          "Texels between charts: drawn round each, and nearer charts are warned of, up to 64 [2]")
      ->check(CLI::Range(0, 64).description(""))
      ->type_name("N");
  report
      .add_option("--tiles", arguments.options.tiles, "Tiles (UDIM 1001, 1002, ...) that charts may lie in, to 100 [1]")
      ->check(CLI::Range(1, 100).description(""))
      ->type_name("N");
  report.add_option("--texcoord", arguments.texcoord, "Which of the sets of UV, TEXCOORD_N of a glTF, up to 7 [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
}

}  // namespace planish::cli
