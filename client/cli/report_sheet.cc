#include "client/cli/report_sheet.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "Eigen/Geometry"
#include "client/cli/mesh_input.h"
#include "client/cli/report_template.h"
#include "client/pictures/map_picture.h"
#include "client/src/errors.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

void MakeDirectory(const fs::path& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (!error) return;
  throw Error(ErrorCode::kPermissionDenied, "FILE_UNWRITABLE",
              directory.string() + ": cannot be made: " + error.message());
}

}  // namespace

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

}  // namespace planish::cli
