#include "client/cli/report.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "Eigen/Geometry"
#include "client/cli/batch_plan.h"
#include "client/cli/batch_table.h"
#include "client/cli/commands.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_page.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "client/files/file_io.h"
#include "client/pictures/map_picture.h"
#include "client/src/errors.h"

namespace planish::cli {

namespace fs = std::filesystem;

ReportSheet::ReportSheet(const std::string& place) {
  const fs::path path = fs::path(place).lexically_normal();
  if (path.extension() == ".html" || path.extension() == ".htm") {
    index_ = path;
    pages_ = path.parent_path() / (path.stem().string() + "_files");
  } else {
    index_ = path / "index.html";
    pages_ = path;
  }
}

std::string ReportSheet::SheetFrom(const std::string& page) const {
  return index_.lexically_relative((pages_ / page).parent_path()).generic_string();
}

void ReportSheet::Prepare() const {
  MakeDirectory(pages_);
  CheckOutput(index_.string());
}

void ReportSheet::WritePage(const std::string& page, const std::string& html) const {
  const fs::path path = pages_ / page;
  MakeDirectory(path.parent_path());
  WriteOutput(path.string(), html);
}

void ReportSheet::Write(const std::vector<SheetRow>& rows) const {
  const fs::path below = index_.parent_path();
  const std::string prefix = pages_.lexically_relative(below).generic_string();
  const std::string title = index_.filename() == "index.html"
                                ? fs::absolute(pages_).lexically_normal().filename().string()
                                : index_.stem().string();
  WriteOutput(index_.string(), SheetPage(title, below == pages_ || prefix == "." ? "" : prefix + "/", rows));
}

std::string SheetPage(const std::string& title, const std::string& pages_from_sheet,
                      const std::vector<SheetRow>& rows) {
  Json sheet = {{"version", Version()}, {"title", title}, {"rows", Json::array()}};
  for (const SheetRow& row : rows) {
    Json json = {{"name", row.name}, {"result", row.result}};
    if (!row.page.empty()) json["page"] = pages_from_sheet + row.page;
    if (!row.message.empty()) json["message"] = row.message;
    if (row.triangles > 0) json["triangles"] = row.triangles;
    if (row.seconds >= 0) json["seconds"] = row.seconds;
    if (row.card.is_object()) {
      for (const auto& [key, value] : row.card.items()) {
        if (key != "made") json[key] = value;
      }
    }
    sheet["rows"].push_back(std::move(json));
  }
  return FillTemplate(SheetTemplate(),
                      "<script type=\"application/json\" id=\"planish-sheet\">" + ForScript(sheet) + "</script>\n");
}

std::string SheetPicture(const Mesh& mesh, const std::vector<double>& uv) {
  MapPictureOptions options;
  options.height = 160;
  options.checks = 20;
  Eigen::AlignedBox2d box(Vec2(0, 0), Vec2(1, 1));
  for (std::size_t c = 0; c < uv.size() / 2; ++c) box.extend(Vec2(uv[2 * c], uv[2 * c + 1]));
  std::vector<double> inside = uv;
  const double size = box.sizes().maxCoeff();
  if (size > 1) {
    for (std::size_t i = 0; i < inside.size(); ++i) inside[i] = (inside[i] - box.min()[i % 2]) / size;
  }
  Image image = DrawMap(mesh, inside, options);
  // Fewer shades are a third of the bytes.
  for (Rgb& pixel : image.pixels) {
    for (std::uint8_t* const part : {&pixel.r, &pixel.g, &pixel.b}) {
      *part = static_cast<std::uint8_t>((*part + 8) / 17 * 17);
    }
  }
  absl::StatusOr<std::string> png = EncodePng(image);
  if (!png.ok()) throw ErrorFrom(png.status());
  return *std::move(png);
}

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

// Of a page about the UV that a file has.
double PaddingOf(const Arguments& arguments) {
  return arguments.options.padding.value_or(2);
}

// Newton stops there unless told otherwise (planish.v1.UnwrapOptions.tolerance).
constexpr double kDefaultTolerance = 1e-9;

// `output`: where the mesh went; empty: to stdout.
FinishedPage UnwrapPage(const MeshInput& input, const UnwrapResult& result, const std::string& output,
                        const Arguments& arguments, const Execution& execution, const SheetMember* member) {
  const Atlas& atlas = result.report.atlas;
  const double padding = atlas.pack ? atlas.padding : 0;
  const MapCheckOptions options = CheckOptionsOf(atlas.texture_size, std::max(atlas.tiles, 1), padding);
  // Of the UV that came in no distance was asked for.
  const MapCheckOptions options_before = CheckOptionsOf(atlas.texture_size, arguments.options.tiles, 0);
  const CheckedMap after = CheckMapOf(input, result.uv.As<double>(), options, execution);
  CheckedMap before;
  if (!input.CornerTexcoords().empty()) before = CheckMapOf(input, options_before, execution);
  std::vector<ReportedMap> maps;
  if (before.has_uv()) maps.push_back({"before", input, before, options_before, 0});
  std::error_code ignored;
  const bool has_name = !FileName(output).empty() && !std::filesystem::is_directory(output, ignored);
  const std::string name = FileName(has_name ? output : input.path());
  maps.push_back({before.has_uv() ? "after" : name, input, after, options, padding});
  Json json = ReportJson(result, result.report, "");
  json["tolerance"] = arguments.options.solver.tolerance > 0 ? arguments.options.solver.tolerance : kDefaultTolerance;
  if (member == nullptr) return ReportPage(maps, json, name);
  SheetMember whole = *member;
  whole.picture = SheetPicture(after.mesh, after.uv);
  return ReportPage(maps, json, name, whole);
}

// Writes the page about the UV that a file has.
Json WriteFilePage(const SheetPageJob& job, const MeshInput& input, const Arguments& arguments,
                   const Execution& execution) {
  const double padding = PaddingOf(arguments);
  const MapCheckOptions options = CheckOptionsOf(arguments.options.texture_size, arguments.options.tiles, padding);
  const CheckedMap map = CheckMapOf(input, options, execution);
  if (execution.IsCancelled()) return nullptr;
  RequireUv(input, map);
  const SheetMember member = {job.sheet.SheetFrom(job.page), job.made, SheetPicture(map.mesh, map.uv)};
  const FinishedPage page =
      ReportPage({{FileName(input.path()), input, map, options, padding}}, std::nullopt, "", member);
  job.sheet.WritePage(job.page, page.html);
  return page.card;
}

int ReportOne(const Arguments& arguments, const Execution& execution) {
  std::optional<Json> job_report;
  if (!arguments.job_report.empty()) job_report = ReadJobReport(arguments.job_report);
  if (arguments.output != "-") CheckOutput(arguments.output);
  const double padding = PaddingOf(arguments);
  const MapCheckOptions options = CheckOptionsOf(arguments.options.texture_size, arguments.options.tiles, padding);
  const MeshInput first({arguments.input}, arguments.texcoord);
  const CheckedMap first_map = CheckMapOf(first, options, execution);
  if (!execution.IsCancelled()) RequireUv(first, first_map);
  std::optional<MeshInput> second;
  CheckedMap second_map;
  if (!arguments.more_inputs.empty()) {
    const std::string& path = arguments.more_inputs.front();
    const bool is_gltf = FormatOfPath(path) == MeshFormat::kGltf || FormatOfPath(path) == MeshFormat::kGlb;
    second.emplace(std::vector<std::string>{path}, is_gltf ? arguments.texcoord : 0);
    second_map = CheckMapOf(*second, options, execution);
    if (!execution.IsCancelled()) RequireUv(*second, second_map);
  }
  if (execution.IsCancelled()) return kInterrupted;
  std::string name = FileName(arguments.input), second_name = second ? FileName(second->path()) : "";
  if (name == second_name) name += " (A)", second_name += " (B)";
  std::vector<ReportedMap> maps = {{name, first, first_map, options, padding}};
  if (second) maps.push_back({second_name, *second, second_map, options, padding});
  WriteOutput(arguments.output, ReportPage(maps, job_report).html);
  return kOk;
}

int ReportMany(const Arguments& arguments, const Execution& execution) {
  const ReportSheet sheet(arguments.output);
  Arguments as_batch = arguments;
  as_batch.output = sheet.pages().string();
  const BatchPlan plan = PlanBatch(as_batch);
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
      row.card = WriteFilePage(job, MeshInput({item.input}, item.texcoord), arguments, execution);
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

FinishedPage UnwrapReport(const MeshInput& input, const UnwrapResult& result, const Arguments& arguments) {
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  const std::string output = arguments.output == "-" ? "" : arguments.output;
  return UnwrapPage(input, result, output, arguments, execution, nullptr);
}

Json WritePage(const SheetPageJob& job, const MeshInput& input, const UnwrapResult& result,
               const Arguments& arguments) {
  const SheetMember member = {job.sheet.SheetFrom(job.page), job.made, ""};
  const FinishedPage page = UnwrapPage(input, result, job.output, arguments, {}, &member);
  job.sheet.WritePage(job.page, page.html);
  return page.card;
}

Json KeepPage(const SheetPageJob& job, int texcoord, const Arguments& arguments) {
  Json card = ReadCard(job.sheet.PathOf(job.page));
  if (card.is_object() && card.value("made", "") == job.made) return card;
  const MeshInput input({job.output}, texcoord);
  return WriteFilePage(job, input, arguments, {});
}

int RunReport(const Arguments& arguments, Interrupts& interrupts) {
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
