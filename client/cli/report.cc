#include "client/cli/report.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "Eigen/Geometry"
#include "client/cli/mesh_input.h"
#include "client/cli/report_images.h"
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
  // Reduces the shades: this compresses the picture to a third.
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

constexpr double kSlack = 0.01;  // texels; charts are reported if their distance is below the padding minus this

std::string FileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

// The default tolerance of Newton's method (planish.v1.UnwrapOptions.tolerance).
constexpr double kDefaultTolerance = 1e-9;

// What both maps show, if images moved into the new one.
struct MovedTextures {
  ReportImages images;
  MapTextures before, after;
};

MovedTextures TexturesOf(const UnwrapFiles& files, const CheckedMap& before, const CheckedMap& after) {
  MovedTextures moved;
  std::vector<std::string> paths;
  bool bakes_colors = false;
  for (const OutputOptions& output : files.outputs()) {
    if (IsStream(output.path) || output.textures.mode != TextureMode::kTransfer) return moved;
    paths.push_back(output.path);
    bakes_colors |= output.textures.bake_colors;
  }
  if (paths.empty()) return moved;
  const MeshInput& input = files.input();
  if (before.has_uv()) {
    moved.before =
        moved.images.Of(input, before, files.texcoord(), bakes_colors, files.outputs().front().textures.allow_outside);
  }
  if (moved.images.empty() && !bakes_colors) return moved;
  const int texcoord = files.outputs().front().texcoord;
  moved.after = moved.images.OfWritten(MeshInput(paths, texcoord), after, texcoord);
  return moved.after.list.empty() ? MovedTextures() : moved;
}

// `output`: the file that was written; empty: stdout.
FinishedPage UnwrapPage(const UnwrapFiles& files, const UnwrapResult& result, const std::string& output,
                        const UnwrapOptions& unwrap, const Execution& execution, const SheetMember* member) {
  const MeshInput& input = files.input();
  const Atlas& atlas = result.report.atlas;
  const double padding = atlas.pack ? atlas.padding : 0;
  const MapCheckOptions options = CheckOptionsOf({atlas.texture_size, std::max(atlas.tiles, 1), padding});
  // No padding is required of the UV that the input had.
  const MapCheckOptions options_before = CheckOptionsOf({atlas.texture_size, unwrap.tiles, 0});
  const CheckedMap after = CheckMapOf(input, result.uv.As<double>(), options, execution);
  CheckedMap before;
  if (!input.CornerTexcoords().empty()) before = CheckMapOf(input, options_before, execution);
  MovedTextures moved = TexturesOf(files, before, after);
  std::vector<ReportedMap> maps;
  if (before.has_uv()) maps.push_back({"before", input, before, options_before, 0, std::move(moved.before)});
  std::error_code ignored;
  const bool has_name = !FileName(output).empty() && !std::filesystem::is_directory(output, ignored);
  const std::string name = FileName(has_name ? output : input.path());
  maps.push_back({before.has_uv() ? "after" : name, input, after, options, padding, std::move(moved.after)});
  Json json = ReportJson(result, result.report, "");
  json["tolerance"] = unwrap.solver.tolerance > 0 ? unwrap.solver.tolerance : kDefaultTolerance;
  if (member == nullptr) return ReportPage(maps, &moved.images, json, name);
  SheetMember whole = *member;
  whole.picture = SheetPicture(after.mesh, after.uv);
  return ReportPage(maps, &moved.images, json, name, whole);
}

}  // namespace

MapCheckOptions CheckOptionsOf(const PageTiles& tiles) {
  MapCheckOptions options;
  if (tiles.texture_size != 0) options.texture_size = tiles.texture_size;
  if (tiles.tiles != 0) options.tiles = tiles.tiles;
  options.min_padding = std::max(0.0, tiles.padding - kSlack);
  return options;
}

void RequireUv(const MeshInput& input, const CheckedMap& map) {
  if (map.has_uv()) return;
  throw Error(ErrorCode::kInvalidArgument, "UV_MISSING",
              input.path() + " has no UV to show; planish unwrap --report makes some and shows them");
}

FinishedPage UnwrapReport(const UnwrapFiles& files, const UnwrapResult& result, const std::string& output,
                          const UnwrapOptions& options) {
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  return UnwrapPage(files, result, output == "-" ? "" : output, options, execution, nullptr);
}

Json WritePage(const SheetPageJob& job, const UnwrapFiles& files, const UnwrapResult& result,
               const UnwrapOptions& options) {
  const SheetMember member = {job.sheet.SheetFrom(job.page), job.made, ""};
  const FinishedPage page = UnwrapPage(files, result, job.output, options, {}, &member);
  job.sheet.WritePage(job.page, page.html);
  return page.card;
}

Json WriteFilePage(const SheetPageJob& job, const MeshInput& input, int texcoord, const PageTiles& tiles,
                   const Execution& execution) {
  const MapCheckOptions options = CheckOptionsOf(tiles);
  const CheckedMap map = CheckMapOf(input, options, execution);
  if (execution.IsCancelled()) return nullptr;
  RequireUv(input, map);
  const SheetMember member = {job.sheet.SheetFrom(job.page), job.made, SheetPicture(map.mesh, map.uv)};
  ReportImages images;
  MapTextures textures = images.Of(input, map, texcoord);
  const FinishedPage page =
      ReportPage({{FileName(input.path()), input, map, options, tiles.padding, std::move(textures)}}, &images,
                 std::nullopt, "", member);
  job.sheet.WritePage(job.page, page.html);
  return page.card;
}

Json KeepPage(const SheetPageJob& job, int texcoord, const UnwrapOptions& options) {
  Json card = ReadCard(job.sheet.PathOf(job.page));
  if (card.is_object() && card.value("made", "") == job.made) return card;
  const MeshInput input({job.output}, texcoord);
  const PageTiles tiles = {options.texture_size, options.tiles, static_cast<double>(options.padding.value_or(2))};
  return WriteFilePage(job, input, texcoord, tiles, {});
}

}  // namespace planish::cli
