#include "client/cli/check_command.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <iostream>
#include <optional>
#include <sstream>
#include <system_error>
#include <vector>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {
namespace {

constexpr std::array<Requirement, 6> kRequirements = {Requirement::kUv,           Requirement::kNoOverlap,
                                                      Requirement::kNoFlip,       Requirement::kNoMirror,
                                                      Requirement::kNoDegenerate, Requirement::kInTile};

constexpr char kCheckHelp[] = R"(Examples:
  planish check hero.glb
  planish check *.obj --require=no-overlap,no-flip --max-stretch=1.5
  planish check level.glb --texcoord=1 --texture-size=512 --min-padding=4 --require=all --json

Requirements: --require takes a comma-separated list of
  uv             every triangle has UV
  no-overlap     no two triangles share a part of the map
  no-flip        no triangle is turned over against the rest of its chart
  no-mirror      no chart is mirrored as a whole
  no-degenerate  no triangle is a line or a point in the map
  in-tile        every triangle lies in one of the tiles
  all            all of these

Needs no server; the UV may come from any program. Several files are checked one by one; --json then prints a line for
each and a last line {"summary": ...}. Exit codes: 0 every requirement is met, 1 some are not, or a file has no UV, 2
bad usage or an unreadable file.)";

// Adds the requirements of a comma-separated list. Throws CLI::ValidationError for an unknown word.
void AddRequirements(const std::string& text, std::set<Requirement>* required) {
  std::istringstream list(text);
  for (std::string word; std::getline(list, word, ',');) {
    if (word == "all") {
      required->insert(kRequirements.begin(), kRequirements.end());
      continue;
    }
    const auto found = std::find_if(kRequirements.begin(), kRequirements.end(),
                                    [&](Requirement requirement) { return word == ToString(requirement); });
    if (found == kRequirements.end()) {
      std::string known;
      for (const Requirement requirement : kRequirements) known += std::string(ToString(requirement)) + ", ";
      throw CLI::ValidationError("--require", "there is no requirement \"" + word + "\"; there are " + known + "all");
    }
    required->insert(*found);
  }
}

void SetTexcoord(const std::string& text, CheckArguments* arguments) {
  arguments->all_texcoords = text == "all";
  if (arguments->all_texcoords) return;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, arguments->texcoord);
  if (error != std::errc() || rest != end || arguments->texcoord < 0 || arguments->texcoord > kLargestTexcoord) {
    throw CLI::ValidationError(
        "--texcoord", text + " is neither a number from 0 to " + std::to_string(kLargestTexcoord) + " nor all");
  }
}

}  // namespace

void AddFlags(CLI::App& app, CheckArguments& arguments) {
  app.footer(kCheckHelp);
  app.add_option("IN", arguments.inputs.first, "Mesh file, as for unwrap")->required()->type_name("");
  app.add_option("MORE", arguments.inputs.more, "Further files, checked one by one")->type_name("");
  app.add_option_function<std::string>(
         "--require",
         [&arguments](const std::string& text) { AddRequirements(text, &arguments.requirements.required); },
         "Requirements on the UV, see Requirements below [only that there are UV]")
      ->type_name("LIST");
  app.add_option("--max-stretch", arguments.requirements.max_stretch,
                 "No chart may have a larger root mean square stretch (1: none), 1.001 to 100")
      ->check(CLI::Range(1.001, 100.0).description(""))
      ->type_name("X");
  app.add_option("--min-padding", arguments.requirements.min_padding,
                 "No two charts may be nearer than this, in texels, up to 64; 0.01 texels less count as rounding")
      ->check(CLI::Range(0.0, 64.0).description(""))
      ->type_name("TEXELS");
  AddTileSize(app, arguments.texture_size);
  AddTiles(app, arguments.tiles);
  app.add_option_function<std::string>(
         "--texcoord", [&arguments](const std::string& text) { SetTexcoord(text, &arguments); },
         "Check the UV set TEXCOORD_N of a glTF, N up to 63; all: every set that the file has [0]")
      ->type_name("N|all");
  AddJson(app, arguments.json);
}

std::string Check(CheckArguments& arguments) {
  const std::vector<std::string> inputs = arguments.inputs.All();
  std::string problem = CheckStreams(inputs);
  if (!problem.empty()) return problem;
  if (arguments.all_texcoords && std::count(inputs.begin(), inputs.end(), "-") > 0) {
    return "- (standard input) can be read once only; --texcoord=all reads a file once for each set of UV";
  }
  return inputs.size() == 1 ? CheckTexcoord(arguments.texcoord, inputs.front()) : "";
}

namespace {

// Checks one file after the other, and counts results.
class CheckRun {
 public:
  CheckRun(const CheckArguments& arguments, const Execution& execution) : arguments_(arguments), execution_(execution) {
    if (arguments.texture_size != 0) options_.texture_size = arguments.texture_size;
    if (arguments.tiles != 0) options_.tiles = arguments.tiles;
    options_.min_padding = arguments.requirements.min_padding;
  }

  void File(const std::string& path) {
    ++files_;
    try {
      const int first = arguments_.all_texcoords || !HasSets(path) ? 0 : arguments_.texcoord;
      const MeshInput input({path}, first);
      const std::vector<int> sets = UvSets(input.file());
      if (!arguments_.all_texcoords || sets.empty()) return Map(input, first, sets);
      for (const int set : sets) {
        if (!execution_.IsCancelled()) Map(MeshInput({path}, set), set, sets);
      }
    } catch (const Error& error) {
      ++unreadable_;
      std::cerr << ErrorText(error, Places(error.metadata()), StderrTerminal());
      if (arguments_.json) {
        Print({{"file", path},
               {"error", {{"reason", error.reason()}, {"message", error.what()}, {"metadata", error.metadata()}}},
               {"ok", false}});
      }
    }
  }

  int End() const {
    if (IsSeveral()) {
      if (arguments_.json) {
        Print({{"summary", {{"files", files_}, {"maps", maps_}, {"failed", failed_}, {"unreadable", unreadable_}}}});
      } else {
        std::cout << Counted(files_, "file", "files") << ", " << Counted(maps_, "map", "maps") << ": "
                  << (failed_ == 0 ? "all as required" : WithCommas(failed_) + " not as required")
                  << (unreadable_ == 0 ? "" : ", " + Counted(unreadable_, "file is unreadable", "files are unreadable"))
                  << ".\n";
      }
    }
    std::cout << std::flush;
    return unreadable_ > 0 ? kUsage : failed_ > 0 ? kFailed : kOk;
  }

 private:
  static bool HasSets(const std::string& path) {
    const std::optional<MeshFormat> format = FormatOfPath(path);
    return IsStream(path) || format == MeshFormat::kGltf || format == MeshFormat::kGlb;
  }
  bool IsSeveral() const { return !arguments_.inputs.more.empty() || arguments_.all_texcoords; }

  void Print(const Json& json) const { std::cout << (IsSeveral() ? ToLine(json) + "\n" : ToText(json)) << std::flush; }

  void Map(const MeshInput& input, int set, const std::vector<int>& sets) {
    const CheckedMap map = CheckMapOf(input, options_, execution_);
    if (execution_.IsCancelled()) return;
    ++maps_;
    const std::vector<RequirementResult> results = CheckRequirements(arguments_.requirements, map);
    failed_ += AreMet(results) ? 0 : 1;
    if (arguments_.json) return Print(CheckJson(input, set, sets, options_, map, results));
    std::cout << CheckText(input, set, sets, options_, map, results) << std::flush;
  }

  const CheckArguments& arguments_;
  const Execution& execution_;
  MapCheckOptions options_;
  std::int64_t files_ = 0, maps_ = 0, failed_ = 0, unreadable_ = 0;
};

}  // namespace

int Run(const CheckArguments& arguments, Interrupts& interrupts) {
  int exit_code = kOk;
  const bool is_interrupted = IsInterruptedIn(interrupts, [&](const Execution& execution) {
    CheckRun run(arguments, execution);
    for (const std::string& path : arguments.inputs.All()) {
      if (!execution.IsCancelled()) run.File(path);
    }
    if (!execution.IsCancelled()) exit_code = run.End();
  });
  if (is_interrupted) {
    std::cerr << "planish: interrupted\n";
    return kInterrupted;
  }
  return exit_code;
}

}  // namespace planish::cli
