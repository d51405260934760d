#include "client/files/mesh_output.h"

#include <algorithm>
#include <new>
#include <optional>
#include <stdexcept>

#include "client/files/gltf_document.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_textures.h"
#include "client/files/obj_textures.h"
#include "client/files/painted_colors.h"
#include "client/files/ply_format.h"
#include "client/files/writers.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/local_origin.h"

namespace planish {
namespace {

absl::Status Unsupported(const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "OUTPUT_UNSUPPORTED", message);
}

bool IsGltf(MeshFormat format) {
  return format == MeshFormat::kGltf || format == MeshFormat::kGlb;
}

absl::StatusOr<WrittenMesh> OneFile(const OutputOptions& options, absl::StatusOr<std::string> bytes) {
  if (!bytes.ok()) return bytes.status();
  WrittenMesh written;
  written.files.push_back({options.path, *std::move(bytes)});
  return written;
}

// Warns if positions are so far from the origin that floats are coarse: Draco has only floats and no translation.
void WarnOfFarPositions(const PolygonMesh& mesh, std::vector<OutputWarning>* warnings) {
  if (LocalOrigin(mesh.positions).isZero(0)) return;
  warnings->push_back({"POSITION_PRECISION",
                       "the mesh lies too far from the origin for the floats of .drc, which round its positions; .glb, "
                       ".ply, .obj and .off keep them"});
}

// An OBJ with its material file and images, if these must be moved to the new UV.
absl::StatusOr<WrittenMesh> ObjAndImages(const MeshFile& file, const WrittenPolygons& written,
                                         const OutputOptions& options) {
  WrittenMesh result;
  ObjMaterialEdit materials;
  ObjTextures textures(file, options);
  if (options.textures.mode == TextureMode::kLeave || IsStream(options.path)) {
    textures.Warn(&result.warnings);  // stdout has no folder for files beside it
  } else if (options.textures.mode == TextureMode::kDrop) {
    textures.Drop(&materials, &result);
  } else {
    PLANISH_RETURN_IF_ERROR(textures.Move(written, &materials, &result));
  }
  result.files.push_back({options.path, WriteObj(file, written, options.uv_is_float, materials)});
  return result;
}

// "a.png, b.png and 3 more".
std::string SomeOf(const std::vector<std::string>& names) {
  constexpr std::size_t kMostNamed = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMostNamed); ++i) text += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kMostNamed) text += " and " + std::to_string(names.size() - kMostNamed) + " more";
  return text;
}

// The images that comments of a PLY name; none for other formats.
std::vector<std::string> ImagesOfPly(const MeshFile& file) {
  if (file.format != MeshFormat::kPly) return {};
  const absl::StatusOr<PlyHeader> header = ReadPlyHeader(file.path, file.bytes);
  if (!header.ok()) return {};
  return {header->images.begin(), header->images.end()};
}

// Whether each corner keeps the UV that it has in the file.
bool KeepsUv(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float) {
  const std::vector<std::int32_t>& old = file.mesh.corner_texcoord;
  if (old.empty() || !written.torn.empty()) return false;
  for (std::size_t c = 0; c < old.size(); ++c) {
    if (old[c] == kNoId) return false;
    const Vec2& before = file.mesh.texcoords[static_cast<std::size_t>(old[c])];
    for (int k = 0; k < 2; ++k) {
      const double after = written.corner_uv[2 * c + static_cast<std::size_t>(k)];
      const bool same = uv_is_float ? static_cast<float>(after) == static_cast<float>(before[k]) : after == before[k];
      if (!same) return false;
    }
  }
  return true;
}

// A PLY from a PLY. The images that it names are not resampled, so they fit only if no UV changes.
absl::StatusOr<WrittenMesh> PlyAndImages(const MeshFile& file, const WrittenPolygons& written,
                                         const OutputOptions& options) {
  const std::vector<std::string> images = ImagesOfPly(file);
  const TextureMode mode = options.textures.mode;
  const bool fits = KeepsUv(file, written, options.uv_is_float) && !options.textures.bake_colors;
  const bool keeps = mode == TextureMode::kLeave || (fits && mode == TextureMode::kTransfer);
  PLANISH_ASSIGN_OR_RETURN(WrittenMesh result, OneFile(options, WritePly(file, written, options.uv_is_float, keeps)));
  if (images.empty() || fits || mode == TextureMode::kDrop) return result;
  if (keeps) {
    result.warnings.push_back({"TEXTURE_UV_REPLACED", "comments of the PLY name images (" + SomeOf(images) +
                                                          "), and the file now holds the new UV: these images no "
                                                          "longer fit"});
  } else {
    result.warnings.push_back({"TEXTURE_DROPPED", "comments of the PLY that name images (" + SomeOf(images) +
                                                      ") were removed: the file now holds the new UV, and only images "
                                                      "of glTF and OBJ are drawn for these"});
  }
  return result;
}

// Warns if a conversion to another format leaves images out. Nobody needs the warning who asked for it (kDrop).
void WarnOfLeftImages(const MeshFile& file, const OutputOptions& options, std::vector<OutputWarning>* warnings) {
  const bool is_own = file.format == options.format || (IsGltf(file.format) && IsGltf(options.format));
  if (is_own || options.textures.mode == TextureMode::kDrop) return;
  std::vector<std::string> images = ImagesOfPly(file);
  if (file.gltf) images = ImagesShown(*file.gltf);
  if (file.format == MeshFormat::kObj) images = ObjTextures(file, options).Files();
  if (images.empty()) return;
  const std::string left = " to another format leaves out images (" + SomeOf(images) + ")";
  if (file.format == MeshFormat::kPly) {
    warnings->push_back(
        {"TEXTURE_DROPPED", "a conversion from PLY" + left + ": only images of glTF and OBJ are drawn for the new UV"});
    return;
  }
  warnings->push_back({"TEXTURE_DROPPED", std::string("a conversion from ") + (file.gltf ? "glTF" : "OBJ") + left +
                                              ", and keeps at most the names of materials; write " +
                                              (file.gltf ? ".glb or .gltf" : ".obj") + " to keep them"});
}

// Writes the mesh in the format of the output. `base_color`: as for PlainGltf().
absl::StatusOr<WrittenMesh> WriteAs(const MeshFile& file, const WrittenPolygons& written, const OutputOptions& options,
                                    const std::string& base_color) {
  const bool is_own = file.format == options.format;
  const PolygonMesh& mesh = written.mesh;
  const std::vector<double>& uv = written.corner_uv;
  switch (options.format) {
    case MeshFormat::kObj:
      if (is_own) return ObjAndImages(file, written, options);
      return OneFile(options, PlainObj(mesh, uv, options.uv_is_float));
    case MeshFormat::kPly:
      if (is_own) return PlyAndImages(file, written, options);
      return OneFile(options, PlainPly(mesh, uv, options.uv_is_float));
    case MeshFormat::kOff:
      return OneFile(options,
                     is_own ? WriteOff(file, written, options.uv_is_float) : PlainOff(mesh, uv, options.uv_is_float));
    case MeshFormat::kDraco: {
      absl::StatusOr<WrittenMesh> draco = OneFile(options, is_own ? WriteDraco(file, uv) : PlainDraco(mesh, uv));
      if (draco.ok() && !is_own) WarnOfFarPositions(file.mesh, &draco->warnings);
      return draco;
    }
    case MeshFormat::kGltf:
    case MeshFormat::kGlb:
      return IsGltf(file.format) ? WriteGltf(*file.gltf, uv, options) : PlainGltf(mesh, uv, options, base_color);
    case MeshFormat::kStl:
      break;
  }
  return InternalError("no writer for this format");
}

absl::StatusOr<WrittenMesh> Write(const MeshFile& file, const PolygonUv& polygon_uv, const OutputOptions& options) {
  const std::vector<double>& uv = polygon_uv.corner_uv;
  std::optional<PolygonMesh> parts;
  if (!polygon_uv.torn.empty()) parts = WithTornPolygons(file.mesh, polygon_uv.torn);
  const PolygonMesh& mesh = parts ? *parts : file.mesh;
  if (uv.size() != 2 * mesh.corner_vertex.size()) {
    return InternalError("UV of " + std::to_string(uv.size() / 2) + " corners for a mesh of " +
                         std::to_string(mesh.corner_vertex.size()));
  }
  const WrittenPolygons written = {mesh, uv, polygon_uv.torn};
  std::vector<OutputWarning> warnings;
  WarnOfLeftImages(file, options, &warnings);
  std::string png;
  if (PaintsColors(file, options)) {
    PLANISH_ASSIGN_OR_RETURN(png, PaintColors(file, written, options, &warnings));
  }
  PLANISH_ASSIGN_OR_RETURN(WrittenMesh result, WriteAs(file, written, options, png));
  if (!png.empty() && !IsGltf(options.format)) AddPaintedImage(file, options, std::move(png), &result);
  result.warnings.insert(result.warnings.end(), warnings.begin(), warnings.end());
  return result;
}

// OUTPUT_UNSUPPORTED unless the new set of UV directly follows or replaces one of the existing sets, or gaps are
// filled.
absl::Status CheckTexcoord(const MeshFile& file, const OutputOptions& options) {
  if (!IsGltf(file.format) || options.fills_texcoords) return absl::OkStatus();
  const int texcoord = options.texcoord;
  for (const GltfPrimitive& primitive : file.gltf->primitives) {
    const Json& attributes = PrimitiveJson(file.gltf->document.json, primitive)["attributes"];
    for (int n = 0; n < texcoord; ++n) {
      const std::string name = "TEXCOORD_" + std::to_string(n);
      if (attributes.contains(name)) continue;
      return Unsupported(file.path + ": meshes[" + std::to_string(primitive.mesh) + "].primitives[" +
                         std::to_string(primitive.primitive) + "] has no " + name + ", and glTF allows no TEXCOORD_" +
                         std::to_string(texcoord) + " without it; make that one first, with --output-texcoord=" +
                         std::to_string(n) + ", or give --textures=keep, which fills it with the new UV");
    }
  }
  return absl::OkStatus();
}

// Returns the result of work(), or its exception as an error. Values of a glTF's JSON that nobody checked have whatever
// type the file gives them.
template <typename Work>
auto Guarded(const MeshFile& file, const OutputOptions& options, const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
  } catch (const std::length_error&) {
  } catch (const Json::exception& error) {
    if (!file.gltf) return InternalError(options.path + ": " + error.what());
    return MakeError(absl::StatusCode::kInvalidArgument, "FILE_MALFORMED",
                     file.path + ": a value of the JSON is of another kind than glTF has there: " + error.what(),
                     {{"path", file.path}});
  }
  return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                   options.path + ": not enough memory to write the file", {{"path", options.path}});
}

absl::Status CheckOutputUnguarded(const MeshFile& file, const OutputOptions& options) {
  if (options.format == MeshFormat::kStl) {
    return Unsupported(options.path +
                       ": STL has no place for UV; give a name that ends in .obj, .ply, .off, .gltf, .glb or .drc");
  }
  if (options.texcoord < 0 || options.texcoord > kLargestTexcoord) {
    return Unsupported(file.path + ": the new UV cannot become TEXCOORD_" + std::to_string(options.texcoord) +
                       ", since planish writes sets up to TEXCOORD_" + std::to_string(kLargestTexcoord) +
                       "; remove a set that is not needed, or give --textures=transfer, which replaces one");
  }
  if (options.texcoord > 0 && !IsGltf(options.format)) {
    return Unsupported(options.path + " has one set of UV only; a second one, TEXCOORD_" +
                       std::to_string(options.texcoord) + ", is for glTF");
  }
  if (options.textures.merge_materials && !(file.gltf && IsGltf(options.format))) {
    return Unsupported(options.path + ": --merge-materials joins materials of a glTF in a glTF; " +
                       (file.gltf ? "write .glb or .gltf" : file.path + " is none"));
  }
  if (PaintsColors(file, options)) PLANISH_RETURN_IF_ERROR(CheckPainting(file, options));
  const bool moves = options.textures.mode == TextureMode::kTransfer && !IsStream(options.path);
  if (options.format == MeshFormat::kObj && file.format == MeshFormat::kObj && moves) {
    return ObjTextures(file, options).Check();
  }
  if (!IsGltf(options.format)) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(CheckTexcoord(file, options));
  if (!IsGltf(file.format) || options.textures.mode != TextureMode::kTransfer) return absl::OkStatus();
  return GltfTextures(*file.gltf, options).Check();
}

}  // namespace

bool IsFloatByNature(MeshFormat format) {
  return IsGltf(format) || format == MeshFormat::kDraco;
}

absl::Status CheckOutput(const MeshFile& file, const OutputOptions& options) {
  return Guarded(file, options, [&] { return CheckOutputUnguarded(file, options); });
}

absl::StatusOr<double> EstimateTextureSide(const MeshFile& file, const OutputOptions& options, double total_area) {
  if (options.textures.mode != TextureMode::kTransfer) return 0.0;
  if (IsGltf(options.format) && file.gltf) {
    return Guarded(file, options, [&] { return GltfTextures(*file.gltf, options).EstimateSide(total_area); });
  }
  if (PaintsColors(file, options)) return EstimatePaintedSide(file, total_area);
  if (options.format == MeshFormat::kObj && file.format == MeshFormat::kObj && !IsStream(options.path)) {
    return ObjTextures(file, options).EstimateSide(total_area);
  }
  return 0.0;
}

bool TexturesRead(const MeshFile& file, const OutputOptions& options) {
  if (IsGltf(options.format)) return file.gltf && ReadsTexcoord(*file.gltf, options.texcoord);
  if (options.format != file.format) return false;
  if (file.format == MeshFormat::kPly) return !ImagesOfPly(file).empty();
  return file.format == MeshFormat::kObj && !ObjTextures(file, options).empty();
}

std::optional<int> FreeUvSet(const MeshFile& file) {
  if (!file.gltf) return std::nullopt;
  return FreeTexcoord(*file.gltf);
}

absl::StatusOr<WrittenMesh> WriteMeshWithUv(const MeshFile& file, const PolygonUv& uv, const OutputOptions& options) {
  OutputOptions unchecked = options;
  unchecked.textures.mode = TextureMode::kLeave;  // resampling reads the images, so they are not checked here
  PLANISH_RETURN_IF_ERROR(CheckOutput(file, unchecked));
  if (!options.uv_is_float && IsFloatByNature(options.format)) {
    return MakeError(absl::StatusCode::kInvalidArgument, "UV_PRECISION",
                     options.path +
                         ": this format holds UV as float, and these need double; ask for float "
                         "(--precision=float), or write .obj, .ply or .off");
  }
  return Guarded(file, options, [&] { return Write(file, uv, options); });
}

}  // namespace planish
