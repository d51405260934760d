#include "client/files/obj_textures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "client/files/file_io.h"
#include "client/files/obj_scanner.h"
#include "client/texture/tangents.h"
#include "core/base/error.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

std::string FolderOf(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash + 1);
}

// The names and contents of an OBJ's material files that can be read. Sets *outside to IMAGE_OUTSIDE if a file lies
// outside of the model's folder and !allow_outside.
std::vector<std::pair<std::string, std::string>> ReadLibraries(const std::string& model, std::string_view obj,
                                                               bool allow_outside, absl::Status* outside) {
  std::vector<std::pair<std::string, std::string>> files;
  const auto read = [&](const std::string& name) {
    absl::StatusOr<std::string> text = ReadImageFile(model, name, allow_outside);
    if (!text.ok() && ErrorInfoOf(text.status()).reason == "IMAGE_OUTSIDE") *outside = text.status();
    if (text.ok()) files.emplace_back(name, *std::move(text));
    return text.ok();
  };
  for (std::string name : MaterialLibraries(obj)) {
    std::replace(name.begin(), name.end(), '\\', '/');
    if (read(name)) continue;
    for (std::size_t at = 0; at < name.size();) {
      const std::size_t end = std::min(name.find(' ', at), name.size());
      if (end - at < name.size()) read(name.substr(at, end - at));
      at = end + 1;
    }
  }
  return files;
}

// Whether a height map is really a normal map: most texels are unit vectors, blue is high, and red and green are around
// the middle.
bool LooksLikeNormals(const TextureImage& image) {
  const ImageHeader& header = image.header;
  if (header.channels < 3) return false;
  const std::size_t bytes = static_cast<std::size_t>(header.bits / 8);
  const std::size_t step = static_cast<std::size_t>(header.channels) * bytes;
  std::array<double, 3> mean = {};
  std::int64_t near = 0;
  for (std::size_t i = 0; i < image.texels.size(); i += step) {
    double length = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      // Of 16-bit values, takes the higher byte.
      const double value = image.texels[i + c * bytes + (bytes - 1)] / 255.0;
      mean[c] += value;
      length += (2 * value - 1) * (2 * value - 1);
    }
    near += std::abs(std::sqrt(length) - 1) < 0.15;
  }
  const double count = static_cast<double>(header.texels());
  return mean[2] / count > 0.7 && std::abs(mean[0] / count - 0.5) < 0.15 && std::abs(mean[1] / count - 0.5) < 0.15 &&
         static_cast<double>(near) > 0.8 * count;
}

// Per corner of the file's polygons, the normal of its vn or, without one, the flat normal.
std::vector<std::array<float, 3>> NormalsOfObj(const MeshFile& file) {
  std::vector<std::array<float, 3>> normals;
  std::vector<std::int64_t> of_corner;
  ObjScanner scanner(file.bytes);
  ObjStatement statement;
  while (scanner.Next(&statement)) {
    ObjTokens tokens(file.bytes, statement);
    std::string_view word;
    if (!tokens.Next(&word)) continue;
    if (word == "vn") {
      std::array<float, 3> normal = {};
      for (float& x : normal) {
        double value = 0;
        if (tokens.Next(&word)) ParseDouble(word, &value);
        x = static_cast<float>(value);
      }
      normals.push_back(normal);
    } else if (IsObjFace(word)) {
      while (tokens.Next(&word)) {
        const ObjCorner corner = SplitObjCorner(word);
        std::int64_t index = 0;
        ParseInt(corner.after.substr(corner.after.empty() ? 0 : 1), &index);
        if (index < 0) index += static_cast<std::int64_t>(normals.size()) + 1;
        of_corner.push_back(index - 1);
      }
    }
  }
  const PolygonMesh& mesh = file.mesh;
  std::vector<std::array<float, 3>> result(mesh.corner_vertex.size(), {0, 0, 1});
  of_corner.resize(result.size(), -1);
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    Vec3 flat = Vec3::Zero();
    const std::int64_t begin = mesh.polygon_begin[p], end = mesh.polygon_begin[p + 1];
    for (std::int64_t c = begin; c < end; ++c) {
      const Vec3& a = mesh.positions[mesh.corner_vertex[c]];
      const Vec3& b = mesh.positions[mesh.corner_vertex[c + 1 < end ? c + 1 : begin]];
      flat +=
          Vec3((a.y() - b.y()) * (a.z() + b.z()), (a.z() - b.z()) * (a.x() + b.x()), (a.x() - b.x()) * (a.y() + b.y()));
    }
    const double length = flat.norm();
    if (length > 0) flat /= length;
    for (std::int64_t c = begin; c < end; ++c) {
      const std::int64_t index = of_corner[static_cast<std::size_t>(c)];
      std::array<float, 3>& normal = result[static_cast<std::size_t>(c)];
      if (index >= 0 && index < static_cast<std::int64_t>(normals.size())) {
        normal = normals[static_cast<std::size_t>(index)];
      } else if (length > 0) {
        for (std::size_t i = 0; i < 3; ++i) normal[i] = static_cast<float>(flat[static_cast<int>(i)]);
      }
    }
  }
  return result;
}

double AreaOf(const Vec3& a, const Vec3& b) {
  return std::sqrt(std::max(0.0, a.squaredNorm() * b.squaredNorm() - a.dot(b) * a.dot(b))) / 2;
}

}  // namespace

std::vector<std::string> FilesOfObj(const std::string& path, std::string_view obj) {
  std::set<std::string> files;
  absl::Status outside;
  for (const auto& [name, text] : ReadLibraries(path, obj, true, &outside)) {
    files.insert(name);
    for (const MtlMaterial& material : ParseMtl(text).materials) {
      for (const MtlMap& map : material.maps) files.insert(FolderOf(name) + map.file);
    }
  }
  return std::vector<std::string>(files.begin(), files.end());
}

ObjTextures::ObjTextures(const MeshFile& file, const OutputOptions& options) : file_(file), options_(options) {
  const PolygonMesh& mesh = file.mesh;
  for (const auto& [name, text] : ReadLibraries(file.path, file.bytes, options.textures.allow_outside, &outside_)) {
    libraries_.push_back({FolderOf(name), ParseMtl(text)});
  }
  if (mesh.corner_texcoord.empty() || mesh.polygon_material.empty()) return;
  std::map<std::string, std::pair<std::size_t, std::size_t>> known;
  std::set<std::string> names;
  for (std::size_t l = 0; l < libraries_.size(); ++l) {
    for (std::size_t m = 0; m < libraries_[l].mtl.materials.size(); ++m) {
      known.emplace(libraries_[l].mtl.materials[m].name, std::pair(l, m));
      names.insert(libraries_[l].mtl.materials[m].name);
    }
  }
  std::map<std::tuple<std::string, double, double, double, double, bool, int, bool, bool, std::int32_t>, std::size_t>
      by_key;
  std::set<std::int32_t> seen;
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    const std::int32_t id = mesh.polygon_material[static_cast<std::size_t>(p)];
    if (id < 0) continue;
    const std::vector<std::int32_t>& atlases = options.textures.polygon_atlas;
    const std::int32_t atlas = atlases.empty() ? 0 : atlases[static_cast<std::size_t>(p)];
    if (group_of_.contains({id, atlas})) continue;
    const auto found = known.find(mesh.material_names[static_cast<std::size_t>(id)]);
    if (found == known.end()) continue;
    Group group = {id, atlas, found->second.first, found->second.second, found->first, {}};
    const MtlMaterial& material = MaterialOf(group);
    if (material.maps.empty()) continue;
    for (int i = 2; !seen.insert(id).second && !names.insert(group.name).second; ++i) {
      group.name = found->first + "_" + std::to_string(i);
    }
    const std::size_t g = groups_.size();
    for (const MtlMap& map : material.maps) {
      const std::string path = libraries_[group.library].folder + map.file;
      const auto key = std::tuple(path, map.scale[0], map.scale[1], map.offset[0], map.offset[1], map.clamp,
                                  static_cast<int>(map.meaning), map.may_be_normals, map.has_alpha, atlas);
      const auto [reading, is_new] = by_key.emplace(key, readings_.size());
      if (is_new) readings_.push_back({path, map, {}, {}, ""});
      Reading& target = readings_[reading->second];
      if (target.groups.empty() || target.groups.back() != g) target.groups.push_back(g);
      group.readings.push_back(reading->second);
    }
    group_of_[{id, atlas}] = g;
    groups_.push_back(std::move(group));
  }
}

absl::StatusOr<std::string> ObjTextures::ImageBytes(const Reading& reading) const {
  return ReadImageFile(file_.path, reading.file, options_.textures.allow_outside);
}

absl::Status ObjTextures::Check() const {
  if (!outside_.ok()) return outside_;
  for (const Reading& reading : readings_) {
    const absl::StatusOr<std::string> bytes = ImageBytes(reading);
    if (!bytes.ok()) return WithTextureAdvice(bytes.status());
    const absl::StatusOr<ImageHeader> header = ReadImageHeader(*bytes, file_.path + ": " + reading.file);
    if (!header.ok()) return WithTextureAdvice(header.status());
  }
  return absl::OkStatus();
}

absl::Status ObjTextures::FillTriangles(const WrittenPolygons& polygons,
                                        const std::vector<std::int32_t>& atlas_of_polygon, Reading* reading) const {
  TextureBake& bake = reading->bake;
  const MtlMap& map = reading->map;
  bake.name = file_.path + ": " + reading->file;
  bake.wrap_u = bake.wrap_v = map.clamp ? TextureWrap::kClamp : TextureWrap::kRepeat;
  bake.options.premultiplied = map.has_alpha;
  const PolygonMesh& mesh = polygons.mesh;
  const bool has_frames = bake.options.meaning == TextureMeaning::kNormal;
  const std::vector<std::array<float, 3>> normals =
      has_frames ? OfWrittenCorners(file_.mesh, NormalsOfObj(file_), polygons.torn)
                 : std::vector<std::array<float, 3>>();
  const Triangulation triangles = Triangulate(mesh);
  std::set<std::size_t> groups(reading->groups.begin(), reading->groups.end());
  TangentCorners before, after;
  // By atlas: the tile of its charts, which must all lie in one tile.
  std::map<std::int32_t, Vec2> tile;
  for (std::size_t f = 0; f < triangles.source_polygon.size(); ++f) {
    const auto p = static_cast<std::size_t>(triangles.source_polygon[f]);
    const std::int32_t atlas = atlas_of_polygon.empty() ? 0 : atlas_of_polygon[p];
    const auto group = group_of_.find({mesh.polygon_material[p], atlas});
    if (group == group_of_.end() || !groups.contains(group->second)) continue;
    TextureTriangle triangle;
    std::array<Vec3, 3> position;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto c = static_cast<std::size_t>(triangles.corner_of_triangle[3 * f + k]);
      const std::int32_t id = mesh.corner_texcoord[c];
      const Vec2 old = id < 0 ? Vec2(0, 0) : mesh.texcoords[static_cast<std::size_t>(id)];
      triangle.from[k] = Vec2(map.scale[0] * old.x() + map.offset[0], 1 - (map.scale[1] * old.y() + map.offset[1]));
      triangle.to[k] = Vec2(polygons.corner_uv[2 * c], 1 - polygons.corner_uv[2 * c + 1]);
      position[k] = mesh.positions[static_cast<std::size_t>(mesh.corner_vertex[c])];
      if (!has_frames) continue;
      for (TangentCorners* corners : {&before, &after}) {
        const Vec2& uv = corners == &before ? triangle.from[k] : triangle.to[k];
        corners->positions.push_back({static_cast<float>(position[k].x()), static_cast<float>(position[k].y()),
                                      static_cast<float>(position[k].z())});
        corners->normals.push_back(normals[c]);
        corners->uv.push_back({static_cast<float>(uv.x()), static_cast<float>(1 - uv.y())});
      }
    }
    const Vec2 middle = (triangle.to[0] + triangle.to[1] + triangle.to[2]) / 3;
    const Vec2 own(std::floor(middle.x()), std::floor(middle.y()));
    const auto [known, is_first] = tile.emplace(atlas, own);
    if (!is_first && known->second != own) {
      return MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID",
                       options_.path +
                           ": the charts of a material lie in several tiles, and it has one image for all of "
                           "them; use --tiles=1, or --textures=drop");
    }
    for (Vec2& to : triangle.to) to -= known->second;
    bake.areas.push_back(AreaOf(position[1] - position[0], position[2] - position[0]));
    bake.triangles.push_back(triangle);
  }
  if (!has_frames) return absl::OkStatus();
  const std::vector<std::array<float, 4>> from = ComputeTangents(before), to = ComputeTangents(after);
  for (std::size_t c = 0; c < from.size(); ++c) bake.frames.push_back({before.normals[c], from[c], to[c]});
  return absl::OkStatus();
}

absl::StatusOr<double> ObjTextures::EstimateSide(double total_area) {
  constexpr double kFilled = 2.0 / 3;
  double side = 0;
  const std::vector<double> nowhere(2 * file_.mesh.corner_vertex.size(), 0.5);
  for (Reading& reading : readings_) {
    PLANISH_ASSIGN_OR_RETURN(const std::string bytes, ImageBytes(reading));
    PLANISH_ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(bytes, reading.file));
    PLANISH_RETURN_IF_ERROR(FillTriangles({file_.mesh, nowhere, {}}, options_.textures.polygon_atlas, &reading));
    for (std::size_t t = 0; t < reading.bake.triangles.size(); ++t) {
      const double leg = std::sqrt(2 * kFilled * reading.bake.areas[t] / total_area);
      reading.bake.triangles[t].to = {Vec2(0, 0), Vec2(leg, 0), Vec2(0, leg)};
    }
    if (header.texels() > 1) {
      side = std::max(side, TextureSideOf(reading.bake.triangles, reading.bake.areas, header.width, header.height));
    }
    side = std::max(side, 1.0);
    reading.bake = TextureBake();
  }
  return side;
}

// The text of the new material file: all materials, with the new names of their images. `with_images` false: without
// the lines that name images, in the materials of groups_.
std::string ObjTextures::MtlText(bool with_images) const {
  std::string text;
  for (std::size_t l = 0; l < libraries_.size(); ++l) {
    const Library& library = libraries_[l];
    const auto append = [&](const MtlMaterial& material, const Group* group) {
      for (std::size_t i = material.first_line; i < material.end_line; ++i) {
        const auto map = std::find_if(material.maps.begin(), material.maps.end(),
                                      [i](const MtlMap& each) { return each.line == i; });
        if (i == material.first_line && group != nullptr) {
          text += "newmtl " + group->name + "\n";
        } else if (map == material.maps.end()) {
          text += library.mtl.lines[i] + "\n";
        } else if (group == nullptr) {
          const fs::path old = fs::absolute(fs::path(file_.path).parent_path() / library.folder / map->file);
          // The line of the old file, except for the path of the image.
          const std::size_t at = library.mtl.lines[i].rfind(map->file);
          const std::string place =
              old.lexically_normal()
                  .lexically_relative(fs::absolute(options_.path).lexically_normal().parent_path())
                  .generic_string();
          text +=
              at == std::string::npos ? library.mtl.lines[i] + "\n" : library.mtl.lines[i].substr(0, at) + place + "\n";
        } else if (with_images) {
          text += MtlLine(*map,
                          readings_[group->readings[static_cast<std::size_t>(map - material.maps.begin())]].new_file) +
                  "\n";
        }
      }
    };
    const std::size_t head =
        library.mtl.materials.empty() ? library.mtl.lines.size() : library.mtl.materials[0].first_line;
    for (std::size_t i = 0; i < head; ++i) text += library.mtl.lines[i] + "\n";
    for (std::size_t m = 0; m < library.mtl.materials.size(); ++m) {
      bool is_grouped = false;
      for (const Group& group : groups_) {
        if (group.library != l || group.material != m) continue;
        append(library.mtl.materials[m], &group);
        is_grouped = true;
      }
      if (!is_grouped) append(library.mtl.materials[m], nullptr);
    }
  }
  return text;
}

absl::Status ObjTextures::Move(const WrittenPolygons& polygons, ObjMaterialEdit* edit, WrittenMesh* written) {
  if (empty()) return absl::OkStatus();
  std::vector<std::string> taken = {file_.path, options_.path};
  for (const std::string& file : FilesOfObj(file_.path, file_.bytes)) {
    taken.push_back((fs::path(file_.path).parent_path() / file).string());
  }
  TextureFileNames names(options_.path, taken);
  std::vector<std::int32_t> atlases;
  if (!options_.textures.polygon_atlas.empty()) {
    atlases = OfWrittenPolygons(options_.textures.polygon_atlas, polygons.torn);
  }
  for (std::size_t i = 0; i < readings_.size(); ++i) {
    Reading& reading = readings_[i];
    if (options_.textures.on_image) {
      options_.textures.on_image({reading.file, i + 1, readings_.size()});
    }
    absl::StatusOr<std::string> bytes = ImageBytes(reading);
    if (!bytes.ok()) return WithTextureAdvice(bytes.status());
    reading.bake.options.meaning = reading.map.meaning;
    if (reading.map.may_be_normals) {
      const absl::StatusOr<TextureImage> image = DecodeImage(*bytes, file_.path + ": " + reading.file);
      if (!image.ok()) return WithTextureAdvice(image.status());
      if (LooksLikeNormals(*image)) reading.bake.options.meaning = TextureMeaning::kNormal;
    }
    PLANISH_RETURN_IF_ERROR(FillTriangles(polygons, atlases, &reading));
    bytes = BakeImage(*std::move(bytes), reading.bake, options_.textures, &written->warnings);
    if (!bytes.ok()) return WithTextureAdvice(bytes.status());
    reading.bake = TextureBake();
    const std::string path = names.Next(reading.file, KindOfImage(*bytes).value_or(ImageKind::kPng));
    reading.new_file = fs::path(path).filename().string();
    written->files.push_back({path, *std::move(bytes)});
  }
  const std::string path = names.NextMaterialFile();
  written->files.push_back({path, MtlText(true)});
  edit->library = fs::path(path).filename().string();
  std::set<std::int32_t> ids;
  for (const Group& group : groups_) ids.insert(group.id);
  if (ids.size() == groups_.size()) return absl::OkStatus();
  // Some materials are written once per atlas: names the material of each polygon.
  const PolygonMesh& mesh = file_.mesh;
  for (std::size_t p = 0; p < mesh.polygon_material.size(); ++p) {
    const std::int32_t id = mesh.polygon_material[p];
    const auto group = group_of_.find({id, options_.textures.polygon_atlas[p]});
    edit->of_polygon.push_back(group != group_of_.end() ? groups_[group->second].name
                               : id < 0                 ? std::string()
                                                        : mesh.material_names[static_cast<std::size_t>(id)]);
  }
  written->warnings.push_back({"MATERIAL_CLONED", "materials that several atlases share are there once for each"});
  return absl::OkStatus();
}

void ObjTextures::Drop(ObjMaterialEdit* edit, WrittenMesh* written) {
  if (empty()) return;
  std::vector<std::string> taken = {file_.path, options_.path};
  for (const std::string& file : FilesOfObj(file_.path, file_.bytes)) {
    taken.push_back((fs::path(file_.path).parent_path() / file).string());
  }
  TextureFileNames names(options_.path, taken);
  const std::string path = names.NextMaterialFile();
  written->files.push_back({path, MtlText(false)});
  edit->library = fs::path(path).filename().string();
  for (const Group& group : groups_) {
    written->warnings.push_back({"TEXTURE_DROPPED", "material " + group.name +
                                                        " no longer has images, which it read "
                                                        "with the UV that were replaced"});
  }
}

std::vector<std::string> ObjTextures::Files() const {
  std::vector<std::string> files;
  for (const Reading& reading : readings_) {
    if (std::find(files.begin(), files.end(), reading.file) == files.end()) files.push_back(reading.file);
  }
  return files;
}

void ObjTextures::Warn(std::vector<OutputWarning>* warnings) const {
  for (const Group& group : groups_) {
    std::string names;
    for (const MtlMap& map : MaterialOf(group).maps)
      names += (names.empty() ? "" : ", ") + map.keyword + " (" + map.file + ")";
    warnings->push_back(
        {"TEXTURE_UV_REPLACED", "material " + group.name + " reads " + names +
                                    ", and the file now holds the new UV: these images no longer fit. "
                                    "Give -o the name of a file, so that they can be written beside it"});
  }
}

}  // namespace planish
