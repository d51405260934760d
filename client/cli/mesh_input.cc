#include "client/cli/mesh_input.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <set>
#include <string_view>
#include <thread>
#include <vector>

#include "Eigen/Geometry"
#include "client/cli/results.h"
#include "client/cli/seams.h"
#include "client/cli/session.h"
#include "client/files/file_io.h"
#include "client/files/vertex_colors.h"
#include "client/pictures/map_picture.h"
#include "client/pictures/uv_preview.h"
#include "client/src/errors.h"

namespace planish::cli {

const char* ToString(AtlasPer per) {
  switch (per) {
    case AtlasPer::kFile:
      return "file";
    case AtlasPer::kMesh:
      return "mesh";
    case AtlasPer::kMaterial:
      return "material";
    case AtlasPer::kGroup:
      return "group";
  }
  return "";
}
namespace {

constexpr std::size_t kMaxPlaces = 4;

// The part that `id` belongs to: the last part whose `first` is at most `id`.
template <typename Part>
const Part& PartOf(const std::vector<Part>& parts, std::int64_t Part::*first, std::int64_t id) {
  const auto behind = std::upper_bound(parts.begin() + 1, parts.end(), id,
                                       [first](std::int64_t value, const Part& part) { return value < part.*first; });
  return *(behind - 1);
}

std::vector<MeshFile> ReadFiles(const std::vector<std::string>& paths, int texcoord) {
  std::vector<MeshFile> files;
  for (const std::string& path : paths) {
    absl::StatusOr<MeshFile> file = ReadMeshFile(path, {texcoord});
    if (!file.ok()) throw ErrorFrom(file.status());
    files.push_back(*std::move(file));
  }
  return files;
}

}  // namespace

MeshInput::MeshInput(const std::vector<std::string>& paths, int texcoord) : MeshInput(ReadFiles(paths, texcoord)) {}

MeshInput::MeshInput(std::vector<MeshFile> files) {
  for (MeshFile& file : files) {
    Part part;
    part.file = std::move(file);
    part.triangulation = Triangulate(part.file.mesh);
    part.first_vertex = mesh_.num_vertices();
    part.first_face = mesh_.num_faces();
    if (!parts_.empty()) {
      const Part& last = parts_.back();
      part.first_file_vertex = last.first_file_vertex + static_cast<std::int64_t>(last.file.mesh.positions.size());
      part.first_polygon = last.first_polygon + last.file.mesh.num_polygons();
    }
    Mesh mesh = std::move(part.triangulation.mesh);
    part.triangulation.mesh = Mesh();
    parts_.push_back(std::move(part));
    if (parts_.size() == 1) {
      mesh_ = std::move(mesh);
      continue;
    }
    const std::int64_t first = mesh_.num_vertices();
    if (first + mesh.num_vertices() > INT32_MAX || mesh_.num_faces() + mesh.num_faces() > INT32_MAX / 3) {
      throw Error(ErrorCode::kInvalidArgument, "MESH_TOO_LARGE", "these files together are too large for one mesh");
    }
    mesh_.positions.insert(mesh_.positions.end(), mesh.positions.begin(), mesh.positions.end());
    for (Face face : mesh.faces) {
      for (std::int32_t& vertex : face) vertex += static_cast<std::int32_t>(first);
      mesh_.faces.push_back(face);
    }
  }
}

std::vector<const MeshFile*> MeshInput::Files() const {
  std::vector<const MeshFile*> files;
  for (const Part& part : parts_) files.push_back(&part.file);
  return files;
}

MeshView MeshInput::view() const {
  if (mesh_.positions.empty() || mesh_.faces.empty()) {
    return MeshView(std::span<const double>(), std::span<const std::int32_t>());
  }
  static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Face) == 3 * sizeof(std::int32_t));
  return MeshView(std::span(mesh_.positions.front().data(), 3 * mesh_.positions.size()),
                  std::span(mesh_.faces.front().data(), 3 * mesh_.faces.size()));
}

template <typename Find>
std::vector<std::int32_t> MeshInput::OfAllParts(const Find& find) const {
  std::vector<std::int32_t> corners;
  for (const Part& part : parts_) {
    for (const std::int32_t c : find(part)) corners.push_back(static_cast<std::int32_t>(3 * part.first_face) + c);
  }
  return corners;
}

std::vector<std::int32_t> MeshInput::SeamCorners(const SeamList& list) const {
  return OfAllParts([&](const Part& part) { return cli::SeamCorners(part.file, part.triangulation, list); });
}

std::vector<std::int32_t> MeshInput::UncutCorners(const SeamList& list) const {
  return OfAllParts([&](const Part& part) { return cli::UncutCorners(part.file, part.triangulation, list); });
}

std::vector<std::int32_t> MeshInput::FacePolygons() const {
  std::vector<std::int32_t> pieces;
  std::int32_t first = 0;
  bool any = false;
  for (const Part& part : parts_) {
    const std::vector<std::int32_t>& own = part.triangulation.piece;
    for (const std::int32_t piece : own) pieces.push_back(first + piece);
    const std::int32_t count = own.empty() ? 0 : *std::max_element(own.begin(), own.end()) + 1;
    any |= count < static_cast<std::int32_t>(own.size());
    first += count;
  }
  return any ? pieces : std::vector<std::int32_t>();
}

std::vector<std::int64_t> MeshInput::FaultyPolygons() const {
  std::vector<std::int64_t> faulty;
  for (const Part& part : parts_) {
    for (const auto& [polygon, fault] : part.triangulation.faulty) faulty.push_back(part.first_polygon + polygon);
  }
  return faulty;
}

std::vector<std::int32_t> MeshInput::CornerTexcoords() const {
  std::vector<std::int32_t> result;
  std::int32_t first = 0;
  bool any = false;
  for (const Part& part : parts_) {
    const std::vector<std::int32_t>& ids = part.file.mesh.corner_texcoord;
    for (const std::int64_t corner : part.triangulation.corner_of_triangle) {
      const std::int32_t id = ids.empty() ? -1 : ids[static_cast<std::size_t>(corner)];
      result.push_back(id < 0 ? -1 : first + id);
    }
    any |= !ids.empty();
    first += static_cast<std::int32_t>(part.file.mesh.texcoords.size());
  }
  return any ? result : std::vector<std::int32_t>();
}

std::vector<double> MeshInput::CornerUv() const {
  std::vector<double> uv;
  for (const Part& part : parts_) {
    const PolygonMesh& mesh = part.file.mesh;
    for (const std::int64_t corner : part.triangulation.corner_of_triangle) {
      const std::int32_t id =
          mesh.corner_texcoord.empty() ? -1 : mesh.corner_texcoord[static_cast<std::size_t>(corner)];
      const Vec2 value = id < 0 ? Vec2(0, 0) : mesh.texcoords[static_cast<std::size_t>(id)];
      uv.insert(uv.end(), {value.x(), value.y()});
    }
  }
  return uv;
}

std::vector<CornerColor> MeshInput::CornerColors() const {
  std::vector<CornerColor> result;
  bool any = false;
  for (const Part& part : parts_) {
    const absl::StatusOr<std::vector<CornerColor>> colors = VertexColors(part.file);
    if (!colors.ok()) throw ErrorFrom(colors.status());
    for (const std::int64_t corner : part.triangulation.corner_of_triangle) {
      result.push_back(colors->empty() ? CornerColor{1, 1, 1, 1} : (*colors)[static_cast<std::size_t>(corner)]);
    }
    any |= !colors->empty();
  }
  return any ? result : std::vector<CornerColor>();
}

std::vector<std::int32_t> MeshInput::FaceMaterials() const {
  std::vector<std::int32_t> result;
  std::int32_t first = 0;
  bool any = false;
  for (const Part& part : parts_) {
    const std::vector<std::int32_t>& ids = part.file.mesh.polygon_material;
    for (const std::int64_t polygon : part.triangulation.source_polygon) {
      const std::int32_t id = ids.empty() ? -1 : ids[static_cast<std::size_t>(polygon)];
      result.push_back(id < 0 ? -1 : first + id);
    }
    any |= !ids.empty();
    first += static_cast<std::int32_t>(part.file.mesh.material_names.size());
  }
  return any ? result : std::vector<std::int32_t>();
}

std::vector<std::string> MeshInput::MaterialNames() const {
  std::vector<std::string> result;
  for (const Part& part : parts_) {
    const std::vector<std::string>& names = part.file.mesh.material_names;
    result.insert(result.end(), names.begin(), names.end());
  }
  return result;
}

std::vector<std::array<double, 3>> MeshInput::MaterialColors() const {
  std::vector<std::array<double, 3>> result;
  for (const Part& part : parts_) {
    std::vector<std::array<double, 3>> colors = planish::MaterialColors(part.file);
    colors.resize(part.file.mesh.material_names.size(), {0.72, 0.72, 0.74});
    result.insert(result.end(), colors.begin(), colors.end());
  }
  return result;
}

namespace {

// The parts of a file that get atlases of their own. `of_polygon` is null if the whole file is one part.
struct FileParts {
  const std::vector<std::int32_t>* of_polygon = nullptr;
  const std::vector<std::string>* names = nullptr;
  const char* what = "";  // for the error if the file has no such parts
};

FileParts PartsOf(const MeshFile& file, AtlasPer per) {
  const PolygonMesh& mesh = file.mesh;
  switch (per) {
    case AtlasPer::kFile:
      break;
    case AtlasPer::kMesh:
      if (file.gltf != nullptr) return {&mesh.polygon_group, &mesh.group_names, "meshes"};
      return {&mesh.polygon_object, &mesh.object_names, "objects, which are an OBJ's meshes"};
    case AtlasPer::kMaterial:
      return {&mesh.polygon_material, &mesh.material_names, "materials"};
    case AtlasPer::kGroup:
      return {&mesh.polygon_group, &mesh.group_names, "objects or groups"};
  }
  return {};
}

}  // namespace

FaceAtlases MeshInput::AtlasesPer(AtlasPer per) const {
  FaceAtlases atlases;
  for (const Part& part : parts_) {
    const FileParts parts = PartsOf(part.file, per);
    if (parts.of_polygon == nullptr) {
      const auto number = static_cast<std::int32_t>(atlases.names.size());
      atlases.of_face.insert(atlases.of_face.end(), part.triangulation.source_polygon.size(), number);
      atlases.names.push_back(std::filesystem::path(part.file.path).filename());
      continue;
    }
    if (parts.of_polygon->empty()) {
      throw Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
                  std::string("--atlas-per=") + ToString(per) + ": " + part.file.path + " has no " + parts.what,
                  {{"field", "face_atlas"}});
    }
    // Faces outside all parts belong to the last atlas.
    const auto none = static_cast<std::int32_t>(parts.names->size());
    std::vector<std::int32_t> number(parts.names->size() + 1, -1), of_triangle;
    for (const std::int64_t polygon : part.triangulation.source_polygon) {
      const std::int32_t id = (*parts.of_polygon)[static_cast<std::size_t>(polygon)];
      of_triangle.push_back(id < 0 ? none : id);
      number[static_cast<std::size_t>(of_triangle.back())] = 0;
    }
    for (std::size_t id = 0; id < number.size(); ++id) {
      if (number[id] < 0) continue;
      number[id] = static_cast<std::int32_t>(atlases.names.size());
      atlases.names.push_back(id < parts.names->size() ? (*parts.names)[id] : std::string("none"));
    }
    for (const std::int32_t id : of_triangle) atlases.of_face.push_back(number[static_cast<std::size_t>(id)]);
  }
  return atlases;
}

std::vector<double> MeshInput::FaceWeights(const std::map<std::string, double>& material_weights) const {
  if (material_weights.empty()) return {};
  const std::vector<std::string> names = MaterialNames();
  for (const auto& [name, weight] : material_weights) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    std::string list;
    for (const std::string& known : std::set<std::string>(names.begin(), names.end())) {
      list += (list.empty() ? "" : ", ") + known;
    }
    throw Error(ErrorCode::kInvalidArgument, "MATERIAL_UNKNOWN",
                "--weight=" + name + ": " + path() + " has no such material" +
                    (list.empty() ? ", nor any other" : "; it has " + list),
                {{"material", name}});
  }
  std::vector<double> weights;
  for (const std::int32_t material : FaceMaterials()) {
    const auto found =
        material < 0 ? material_weights.end() : material_weights.find(names[static_cast<std::size_t>(material)]);
    weights.push_back(found == material_weights.end() ? 1 : found->second);
  }
  return weights;
}

std::int64_t MeshInput::PolygonOf(std::int64_t triangle) const {
  const Part& part = PartOf(parts_, &Part::first_face, triangle);
  return part.first_polygon + part.triangulation.source_polygon[static_cast<std::size_t>(triangle - part.first_face)];
}

ids::Renumbering MeshInput::ToFile() const {
  const auto vertex = [this](std::int64_t id) -> std::int64_t {
    if (id >= mesh_.num_vertices()) return -1;
    const Part& part = PartOf(parts_, &Part::first_vertex, id);
    return part.first_file_vertex + part.triangulation.source_vertex[static_cast<std::size_t>(id - part.first_vertex)];
  };
  const auto face = [this](std::int64_t id) -> std::int64_t { return id >= mesh_.num_faces() ? -1 : PolygonOf(id); };
  return {vertex, face};
}

Error MeshInput::InFileIds(const Error& error) const {
  return Renumbered(error, ToFile());
}

Warning MeshInput::InFileIds(const Warning& warning) const {
  return {warning.reason, warning.message, ids::RenumberMetadata(warning.metadata, ToFile())};
}

std::string MeshInput::Place(const char* element, std::int64_t id) const {
  const bool is_face = std::string_view(element) == "face";
  std::int64_t Part::*const first = is_face ? &Part::first_polygon : &Part::first_file_vertex;
  const Part& part = PartOf(parts_, first, id);
  const std::int64_t own = id - part.*first;
  const auto& lines = is_face ? part.file.mesh.polygon_line : part.file.mesh.vertex_line;
  const std::string name = std::filesystem::path(part.file.path).filename();
  const std::string line = own < static_cast<std::int64_t>(lines.size())
                               ? std::to_string(lines[static_cast<std::size_t>(own)])
                               : std::string();
  const std::string what = std::string(element) + " " + std::to_string(id);
  if (parts_.size() > 1) {
    return what + " (" + element + " " + std::to_string(own) + " of " + name + (line.empty() ? "" : ", line " + line) +
           ")";
  }
  return line.empty() ? what : what + " (" + name + ":" + line + ")";
}

std::string Places(const std::map<std::string, std::string>& metadata, const MeshInput* input) {
  std::string text;
  std::size_t count = 0;
  const auto add = [&](const char* element, std::int64_t id) {
    if (++count > kMaxPlaces) return;
    text += text.empty() ? "" : ", ";
    text += input != nullptr ? input->Place(element, id) : element + (" " + std::to_string(id));
  };
  // If faces are named, the ends of the edges between them are redundant.
  for (const auto& [key, value] : metadata) {
    if (key != "face" && key != "faces") continue;
    for (const std::int64_t id : ids::IdsIn(value)) add("face", id);
  }
  for (const auto& [key, value] : metadata) {
    const bool is_edge = key == "edge" || key == "edges";
    if (key != "vertex" && key != "vertices" && !(is_edge && count == 0)) continue;
    for (const std::int64_t id : ids::IdsIn(value)) add("vertex", id);
  }
  // Also the server names only the first few elements, so the number of further ones is not known.
  return count > kMaxPlaces ? text + ", ..." : text;
}

std::string ErrorLine(const Error& error, const MeshInput* input) {
  const std::string places = Places(error.metadata(), input);
  return error.what() + (" [" + error.reason() + "]") + (places.empty() ? "" : ", at " + places);
}

std::string MeshInput::OutputPath(const Part& part, const std::string& out, bool is_directory) const {
  if (!is_directory) return out;
  return (std::filesystem::path(out) / std::filesystem::path(part.file.path).filename()).string();
}

namespace {

std::int64_t TextureMemory(const TextureArguments& arguments) {
  if (arguments.memory_mb > 0) return arguments.memory_mb * 1000000;
  const std::int64_t pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGE_SIZE);
  return pages > 0 && page > 0 ? pages / 2 * page : 0;
}

TextureOptions TextureOptionsOf(const TextureArguments& arguments) {
  TextureOptions options;
  options.mode = arguments.textures == Textures::kDrop ? TextureMode::kDrop : TextureMode::kTransfer;
  options.memory = TextureMemory(arguments);
  options.allow_outside = arguments.allow_outside;
  options.merge_materials = arguments.merge_materials;
  options.bake_colors = arguments.bake_colors;
  options.threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 64U));
  return options;
}

}  // namespace

std::vector<OutputOptions> MeshInput::Outputs(const std::string& out, int read_texcoord, std::optional<int> texcoord,
                                              const TextureArguments& textures) const {
  std::error_code ignored;
  const bool is_directory = out.ends_with("/") || std::filesystem::is_directory(out, ignored);
  const auto unsupported = [](const std::string& message) {
    return Error(ErrorCode::kInvalidArgument, "OUTPUT_UNSUPPORTED", message);
  };
  if (parts_.size() > 1 && !is_directory) {
    throw unsupported("-o " + out + ": several files need a directory, which keeps their names: -o DIR/");
  }
  std::vector<OutputOptions> outputs;
  std::set<std::string> names;
  for (const Part& part : parts_) {
    if (is_directory && part.file.path == kStandardInput) {
      throw unsupported("-o " + out + ": what comes from standard input has no name; give -o a file");
    }
    OutputOptions output;
    output.path = OutputPath(part, out, is_directory);
    output.texcoord = texcoord.value_or(read_texcoord);
    output.textures = TextureOptionsOf(textures);
    output.fills_texcoords = textures.textures == Textures::kKeep;
    if (!names.insert(output.path).second) {
      throw unsupported("two of the files would both become " + output.path + "; give them different names");
    }
    if (IsStream(output.path)) {
      output.format = part.file.format == MeshFormat::kStl ? MeshFormat::kObj : part.file.format;
    } else if (const std::optional<MeshFormat> format = FormatOfPath(output.path)) {
      output.format = *format;
    } else {
      throw unsupported(output.path +
                        ": the name must end in .obj, .ply, .off, .gltf, .glb or .drc, or be - for stdout");
    }
    if (textures.textures == Textures::kKeep && TexturesRead(part.file, output)) {
      const std::optional<int> free = FreeUvSet(part.file);
      if (texcoord || !free) {
        throw Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
                    part.file.path + ": --textures=keep cannot leave the UV that images are read with: " +
                        (free ? "--output-texcoord=" + std::to_string(*texcoord) +
                                    " replaces them; leave it out, or give " + std::to_string(*free)
                              : std::string("the file has no other set of UV for the new ones. --textures=drop removes "
                                            "the images from the materials")),
                    {{"field", "textures"}});
      }
      output.texcoord = *free;
    }
    const absl::Status status = planish::CheckOutput(part.file, output);
    if (!status.ok()) throw ErrorFrom(status);
    outputs.push_back(output);
  }
  if (is_directory) MakeDirectory(out);
  for (const OutputOptions& output : outputs) cli::CheckOutput(output.path);
  return outputs;
}

std::vector<OutputOptions> MeshInput::WithTextureSize(std::vector<OutputOptions> outputs, int size, int atlas_size,
                                                      int padding,
                                                      const std::vector<std::int32_t>& atlas_of_face) const {
  for (std::size_t p = 0; p < outputs.size(); ++p) {
    TextureOptions& textures = outputs[p].textures;
    textures.size = size;
    // A smaller image would have less than one texel between charts.
    textures.least_size = std::max(1, atlas_size / std::max(1, padding));
    if (atlas_of_face.empty()) continue;
    const std::vector<std::int64_t>& polygons = parts_[p].triangulation.source_polygon;
    textures.polygon_atlas.assign(static_cast<std::size_t>(parts_[p].file.mesh.num_polygons()), 0);
    for (std::size_t f = 0; f < polygons.size(); ++f) {
      textures.polygon_atlas[static_cast<std::size_t>(polygons[f])] =
          atlas_of_face[static_cast<std::size_t>(parts_[p].first_face) + f];
    }
  }
  return outputs;
}

int MeshInput::TextureSideEstimate(const std::vector<OutputOptions>& outputs) const {
  double area = 0;
  for (const Face& face : mesh_.faces) {
    const auto [a, b, c] = TriangleOf(mesh_.positions, face);
    const double of_face = (b - a).cross(c - a).norm() / 2;
    if (std::isfinite(of_face)) area += of_face;
  }
  double side = 0;
  for (std::size_t p = 0; p < outputs.size(); ++p) {
    const absl::StatusOr<double> one = EstimateTextureSide(parts_[p].file, outputs[p], area);
    if (!one.ok()) throw ErrorFrom(one.status());
    side = std::max(side, *one);
  }
  if (side == 0) return 0;
  constexpr int kLeast = 64;  // below this a texel of padding takes too much of the atlas
  return std::clamp(4 * static_cast<int>(std::ceil(side / 4)), kLeast, kLargestAutoTexture);
}

WrittenMesh MeshInput::WithUv(const Uv& uv, const std::vector<OutputOptions>& outputs, std::int64_t* torn) const {
  WrittenMesh written;
  const std::vector<double> numbers = uv.As<double>();
  if (torn != nullptr) *torn = 0;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Part& part = parts_[p];
    const PolygonUv polygon_uv = UvOfPolygons(part.file.mesh, part.triangulation, numbers.data() + 6 * part.first_face);
    if (torn != nullptr) *torn += static_cast<std::int64_t>(polygon_uv.torn.size());
    OutputOptions output = outputs[p];
    output.uv_is_float = uv.precision() == Precision::kFloat;
    absl::StatusOr<WrittenMesh> one = WriteMeshWithUv(part.file, polygon_uv, output);
    if (!one.ok()) throw ErrorFrom(one.status());
    for (OutputFile& file : one->files) written.files.push_back(std::move(file));
    for (const OutputWarning& warning : one->warnings) {
      written.warnings.push_back({warning.reason, output.path + ": " + warning.message});
    }
  }
  return written;
}

std::string MeshInput::Picture(const Uv& uv, double azimuth, double elevation) const {
  constexpr double kRadians = std::numbers::pi / 180;
  MapPictureOptions options;
  options.azimuth = azimuth * kRadians;
  options.elevation = elevation * kRadians;
  absl::StatusOr<std::string> png = EncodePng(DrawMap(mesh_, uv.As<double>(), options));
  if (!png.ok()) throw ErrorFrom(png.status());
  return *std::move(png);
}

std::string MeshInput::Preview(const Uv& uv, const std::string& path, bool packed) const {
  UvPreviewOptions options;
  options.fit = !packed;
  if (path.ends_with(".svg")) return UvPreviewSvg(mesh_, uv.As<double>(), options);
  absl::StatusOr<std::string> png = EncodePng(DrawUvPreview(mesh_, uv.As<double>(), options));
  if (!png.ok()) throw ErrorFrom(png.status());
  return *std::move(png);
}

void WriteOutput(const std::string& path, const std::string& bytes) {
  const absl::Status status = WriteFile(path, bytes);
  if (!status.ok()) throw ErrorFrom(status);
}

void WriteAll(const std::vector<OutputFile>& files, Interrupts& interrupts) {
  interrupts.SetCancel([] {});
  for (const OutputFile& file : files) WriteOutput(file.path, file.bytes);
  interrupts.SetCancel({});
  interrupts.LeaveIfInterrupted();
}

void CheckOutput(const std::string& path) {
  if (IsStream(path)) return;
  const std::filesystem::path directory = std::filesystem::absolute(path).parent_path();
  if (access(directory.c_str(), W_OK) == 0) return;
  throw Error(ErrorCode::kPermissionDenied, "FILE_UNWRITABLE",
              path + ": cannot write to directory " + directory.string() +
                  (access(directory.c_str(), F_OK) == 0 ? "" : ": it does not exist"));
}

void MakeDirectory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (!error) return;
  throw Error(ErrorCode::kPermissionDenied, "FILE_UNWRITABLE",
              directory.string() + ": cannot be made: " + error.message());
}

}  // namespace planish::cli
