#include "client/files/painted_colors.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <utility>

#include "Eigen/Geometry"
#include "client/files/texture_files.h"
#include "client/files/vertex_colors.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr char kNameOfColors[] = "colors";

absl::Status CannotPaint(const OutputOptions& options, const std::string& why) {
  return MakeError(absl::StatusCode::kInvalidArgument, "OUTPUT_UNSUPPORTED",
                   options.path + ": --bake=colors cannot be used here: " + why);
}

double AreaOfTriangle(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (b - a).cross(c - a).norm() / 2;
}

std::string NameInFolder(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

// The offset of the line that follows the one at `at`; the size of the text if there is none.
std::size_t AfterLine(const std::string& text, std::size_t at) {
  const std::size_t end = text.find('\n', at);
  return end == std::string::npos ? text.size() : end + 1;
}

// Names the image in a comment of the PLY's header, and removes comments that name other images.
void NameInPly(const std::string& image, std::string* ply) {
  constexpr std::string_view kComment = "comment TextureFile ";
  std::size_t line = AfterLine(*ply, 0);
  const std::size_t place = AfterLine(*ply, line);  // after "ply" and "format"
  const std::string end = place >= 2 && (*ply)[place - 2] == '\r' ? "\r\n" : "\n";
  for (line = place; ply->compare(line, 10, "end_header") != 0 && line < ply->size();) {
    const std::size_t next = AfterLine(*ply, line);
    if (std::string_view(*ply).substr(line, kComment.size()) == kComment) {
      ply->erase(line, next - line);
    } else {
      line = next;
    }
  }
  ply->insert(place, std::string(kComment) + image + end);
}

}  // namespace

bool PaintsColors(const MeshFile& file, const OutputOptions& options) {
  const bool is_gltf = options.format == MeshFormat::kGltf || options.format == MeshFormat::kGlb;
  return options.textures.bake_colors && options.textures.mode == TextureMode::kTransfer && !(file.gltf && is_gltf);
}

absl::Status CheckPainting(const MeshFile& file, const OutputOptions& options) {
  const bool is_beside = options.format == MeshFormat::kObj || options.format == MeshFormat::kPly;
  if (!is_beside && options.format != MeshFormat::kGltf && options.format != MeshFormat::kGlb) {
    return CannotPaint(options, "this format names no image; write .glb, .gltf, .obj or .ply");
  }
  if (is_beside && IsStream(options.path)) {
    return CannotPaint(options, "the image lies beside the output, so give -o the name of a file");
  }
  if (options.format == MeshFormat::kObj && file.format == MeshFormat::kObj && !file.mesh.material_names.empty()) {
    return CannotPaint(options, "the faces of " + file.path + " have materials of their own");
  }
  return absl::OkStatus();
}

absl::StatusOr<double> EstimatePaintedSide(const MeshFile& file, double total_area) {
  constexpr double kFilled = 2.0 / 3;
  PLANISH_ASSIGN_OR_RETURN(const std::vector<CornerColor> colors, VertexColors(file));
  if (colors.empty()) return 0.0;
  std::vector<TextureTriangle> triangles;
  std::vector<double> areas;
  const Triangulation cut = Triangulate(file.mesh);
  for (const Face& face : cut.mesh.faces) {
    const auto at = [&](std::size_t k) { return cut.mesh.positions[static_cast<std::size_t>(face[k])]; };
    areas.push_back(AreaOfTriangle(at(0), at(1), at(2)));
    const double leg = std::sqrt(2 * kFilled * areas.back() / total_area);
    triangles.push_back({{Vec2(0, 0), Vec2(0, 0), Vec2(0, 0)}, {Vec2(0, 0), Vec2(leg, 0), Vec2(0, leg)}});
  }
  return std::max(1.0, SideOfVertexColors(triangles, areas));
}

absl::StatusOr<std::string> PaintColors(const MeshFile& file, const WrittenPolygons& written,
                                        const OutputOptions& options, std::vector<OutputWarning>* warnings) {
  PLANISH_ASSIGN_OR_RETURN(const std::vector<CornerColor> of_file, VertexColors(file));
  if (of_file.empty()) {
    warnings->push_back({"COLORS_NOT_BAKED", file.path + " has no vertex colours"});
    return std::string();
  }
  const std::vector<CornerColor> colors = OfWrittenCorners(file.mesh, of_file, written.torn);
  TexturePart part;
  part.bake.name = file.path;
  const Triangulation cut = Triangulate(written.mesh);
  for (std::size_t f = 0; f < cut.mesh.faces.size(); ++f) {
    TextureTriangle& triangle = part.bake.triangles.emplace_back();
    std::array<Vec3, 3> place;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto c = static_cast<std::size_t>(cut.corner_of_triangle[3 * f + k]);
      triangle.from[k] = Vec2(0, 0);
      triangle.to[k] = Vec2(written.corner_uv[2 * c], 1 - written.corner_uv[2 * c + 1]);
      place[k] = cut.mesh.positions[static_cast<std::size_t>(cut.mesh.faces[f][k])];
      part.bake.colors.push_back(colors[c]);
      constexpr double kSlack = 0.01;
      if (triangle.to[k].minCoeff() < -kSlack || triangle.to[k].maxCoeff() > 1 + kSlack) {
        return CannotPaint(options, "the map has several tiles, and one image is painted; leave out --atlas-per");
      }
    }
    part.bake.areas.push_back(AreaOfTriangle(place[0], place[1], place[2]));
  }
  const bool has_alpha =
      std::any_of(colors.begin(), colors.end(), [](const CornerColor& color) { return color[3] < 1; });
  part.bake.options = {TextureMeaning::kColor, has_alpha, 1};
  std::vector<TexturePart> parts;
  parts.push_back(std::move(part));
  if (options.textures.on_image) options.textures.on_image({kNameOfColors, 1, 1});
  return BakeParts(std::move(parts), file.path + ": vertex colours", has_alpha, options.textures, warnings);
}

void AddPaintedImage(const MeshFile& file, const OutputOptions& options, std::string png, WrittenMesh* result) {
  std::string& mesh = result->files.back().bytes;
  std::vector<std::string> taken = {file.path, options.path};
  if (file.format == MeshFormat::kObj) {
    for (const std::string& each : FilesOfObj(file.path, file.bytes)) {
      taken.push_back((std::filesystem::path(file.path).parent_path() / each).string());
    }
  }
  TextureFileNames names(options.path, taken);
  const std::string image = names.Next(kNameOfColors, ImageKind::kPng);
  std::vector<OutputFile> beside;
  beside.push_back({image, std::move(png)});
  if (options.format == MeshFormat::kPly) {
    NameInPly(NameInFolder(image), &mesh);
  } else {
    const std::string materials = names.NextMaterialFile();
    std::string mtl;
    std::vector<std::string> all = file.mesh.material_names;
    if (std::find(all.begin(), all.end(), kNameOfColors) == all.end()) all.insert(all.begin(), kNameOfColors);
    for (const std::string& name : all) {
      mtl += "newmtl " + name + "\nKd 1 1 1\nmap_Kd " + NameInFolder(image) + "\n";
    }
    beside.push_back({materials, std::move(mtl)});
    const std::size_t begin = mesh.starts_with("\xEF\xBB\xBF") ? 3 : 0;
    mesh.insert(begin, "mtllib " + NameInFolder(materials) + "\nusemtl " + kNameOfColors + "\n");
  }
  result->files.insert(result->files.begin(), std::make_move_iterator(beside.begin()),
                       std::make_move_iterator(beside.end()));
}

}  // namespace planish
