#include "client/cli/check_flags.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>
#include <string>

#include "CLI/CLI.hpp"
#include "client/cli/arguments.h"

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
  no-flip        no triangle is turned against the rest of its chart
  no-mirror      no chart is mirrored as a whole
  no-degenerate  no triangle is a line or a point in the map
  in-tile        every triangle lies in one of the tiles
  all            all of these

Needs no server; the UV may come from any tool. Several files are judged one by one; with --json there is a line for
each then, and a last one {"summary": ...}. Exit codes: 0 every requirement is met, 1 some are not, or a file has no UV,
2 bad usage or an unreadable file.)";

// Throws CLI::ValidationError for what is none.
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

void SetTexcoord(const std::string& text, Arguments* arguments) {
  arguments->check.all_texcoords = text == "all";
  if (arguments->check.all_texcoords) return;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, arguments->texcoord);
  if (error != std::errc() || rest != end || arguments->texcoord < 0 || arguments->texcoord > 7) {
    throw CLI::ValidationError("--texcoord", text + " is neither a number from 0 to 7 nor all");
  }
}

}  // namespace

const char* ToString(Requirement requirement) {
  switch (requirement) {
    case Requirement::kUv:
      return "uv";
    case Requirement::kNoOverlap:
      return "no-overlap";
    case Requirement::kNoFlip:
      return "no-flip";
    case Requirement::kNoMirror:
      return "no-mirror";
    case Requirement::kNoDegenerate:
      return "no-degenerate";
    case Requirement::kInTile:
      return "in-tile";
  }
  return "";
}

void DefineCheck(CLI::App& app, Arguments& arguments) {
  CLI::App& check = *app.add_subcommand("check", "Judge the UV that a mesh has, from any tool");
  check.parse_complete_callback([&arguments] { arguments.command = Command::kCheck; });
  check.footer(kCheckHelp);
  check.add_option("IN", arguments.input, "Mesh file, as for unwrap")->required()->type_name("");
  check.add_option("MORE", arguments.more_inputs, "Further files, judged one by one")->type_name("");
  check
      .add_option_function<std::string>(
          "--require", [&arguments](const std::string& text) { AddRequirements(text, &arguments.check.required); },
          "What must hold, see below [nothing but that there are UV]")
      ->type_name("LIST");
  check
      .add_option("--max-stretch", arguments.check.max_stretch,
                  "No chart may have a larger root mean square stretch (1: none), 1.001 to 100")
      ->check(CLI::Range(1.001, 100.0).description(""))
      ->type_name("X");
  check
      .add_option("--min-padding", arguments.check.min_padding,
                  "No two charts may be nearer, in texels; a hundredth less is taken for rounding; up to 64")
      ->check(CLI::Range(0.0, 64.0).description(""))
      ->type_name("TEXELS");
  check.add_option("--texture-size", arguments.options.texture_size, "Texels per side of a tile, 16 to 65536 [1024]")
      ->check(CLI::Range(16, 65536).description(""))
      ->type_name("N");
  check
      .add_option("--tiles", arguments.options.tiles, "Tiles (UDIM 1001, 1002, ...) that charts may lie in, to 100 [1]")
      ->check(CLI::Range(1, 100).description(""))
      ->type_name("N");
  check
      .add_option_function<std::string>(
          "--texcoord", [&arguments](const std::string& text) { SetTexcoord(text, &arguments); },
          "Which of the sets of UV, TEXCOORD_N of a glTF, up to 7; all: each that the file has [0]")
      ->type_name("N|all");
  check.add_flag("--json", arguments.json, "Print one JSON object on stdout");
}

}  // namespace planish::cli
