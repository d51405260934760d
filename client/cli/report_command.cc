#include "client/cli/report_command.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "client/cli/commands.h"
#include "client/cli/json.h"
#include "client/files/file_io.h"
#include "client/src/errors.h"

namespace planish::cli {
namespace {

constexpr double kSlack = 0.01;  // texels: nearer charts than the padding less this are told

// The report of an unwrap as a program printed it. Throws planish::Error.
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

void RequireUv(const MeshInput& input, const CheckedMap& map) {
  if (map.has_uv()) return;
  throw Error(ErrorCode::kInvalidArgument, "UV_MISSING",
              input.path() + " has no UV to show; planish unwrap --report makes some and shows them");
}

std::string FileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

MapCheckOptions CheckOptionsOf(int texture_size, int tiles, double padding) {
  MapCheckOptions options;
  if (texture_size != 0) options.texture_size = texture_size;
  if (tiles != 0) options.tiles = tiles;
  options.min_padding = std::max(0.0, padding - kSlack);
  return options;
}

}  // namespace

std::string UnwrapReport(const MeshInput& input, const UnwrapResult& result, const NewtonLog& newton,
                         const Arguments& arguments) {
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  const Atlas& atlas = result.report.atlas;
  const double padding = atlas.pack ? atlas.padding : 0;
  const MapCheckOptions options = CheckOptionsOf(atlas.texture_size, std::max(atlas.tiles, 1), padding);
  // Of the UV that came in no distance was asked for.
  const MapCheckOptions options_before = CheckOptionsOf(atlas.texture_size, arguments.options.tiles, 0);
  const CheckedMap after = CheckMapOf(input, result.uv.AsDouble(), options, execution);
  CheckedMap before;
  if (!input.CornerTexcoords().empty()) before = CheckMapOf(input, options_before, execution);
  std::vector<ReportedMap> maps;
  if (before.has_uv()) maps.push_back({"before", input, before, options_before, 0});
  const std::string name = arguments.output.empty() || arguments.output == "-" ? input.path() : arguments.output;
  maps.push_back({before.has_uv() ? "after" : FileName(name), input, after, options, padding});
  Json json = ReportJson(result, result.report, "");
  json["newton"] = newton.ToJson();
  json["tolerance"] = newton.tolerance();
  return ReportPage(maps, json);
}

int RunReport(const Arguments& arguments, Interrupts& interrupts) {
  const auto interrupter = std::make_shared<Interrupter>();
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  execution.cancel = interrupter.get();
  interrupts.SetCancel([interrupter] { interrupter->Interrupt(); });

  std::optional<Json> job_report;
  if (!arguments.job_report.empty()) job_report = ReadJobReport(arguments.job_report);
  if (arguments.output != "-") CheckOutput(arguments.output);
  const double padding = arguments.options.padding.value_or(2);
  const MapCheckOptions options = CheckOptionsOf(arguments.options.texture_size, arguments.options.tiles, padding);
  const MeshInput first({arguments.input}, arguments.texcoord);
  const CheckedMap first_map = CheckMapOf(first, options, execution);
  RequireUv(first, first_map);
  std::optional<MeshInput> second;
  CheckedMap second_map;
  if (!arguments.more_inputs.empty()) {
    const std::string& path = arguments.more_inputs.front();
    const bool is_gltf = FormatOfPath(path) == MeshFormat::kGltf || FormatOfPath(path) == MeshFormat::kGlb;
    second.emplace(std::vector<std::string>{path}, is_gltf ? arguments.texcoord : 0);
    second_map = CheckMapOf(*second, options, execution);
    RequireUv(*second, second_map);
  }
  interrupts.SetCancel({});
  if (interrupter->IsInterrupted()) {
    std::cerr << "planish: interrupted; nothing was written\n";
    return kInterrupted;
  }
  std::string name = FileName(arguments.input), second_name = second ? FileName(second->path()) : "";
  if (name == second_name) name += " (A)", second_name += " (B)";
  std::vector<ReportedMap> maps = {{name, first, first_map, options, padding}};
  if (second) maps.push_back({second_name, *second, second_map, options, padding});
  WriteOutput(arguments.output, ReportPage(maps, job_report));
  return kOk;
}

}  // namespace planish::cli
