// The mesh files of a command, and the conversion of the server's element ids to elements and lines of these files.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/seams.h"
#include "client/files/mesh_output.h"
#include "client/texture/texture_baker.h"
#include "core/base/element_ids.h"
#include "planish/client.h"

namespace planish::cli {

class Interrupts;

// Which parts of the input get an atlas each (--atlas-per).
enum class AtlasPer { kFile, kMesh, kMaterial, kGroup };
const char* ToString(AtlasPer per);  // "file", ...

// The atlas of each face, from 0 on, and the names of the atlases.
struct FaceAtlases {
  std::vector<std::int32_t> of_face;
  std::vector<std::string> names;
};

// Several files are sent to the server as one mesh; no vertices of different files are joined. The ids of a file's
// faces and vertices then continue those of the file before it.
class MeshInput {
 public:
  // Reads the files; at least one path. `texcoord`: the UV set that is read from glTF files (client/files/mesh_file.h).
  // Throws planish::Error: FILE_UNREADABLE, FILE_FORMAT_UNKNOWN, FILE_UNSUPPORTED, FILE_MALFORMED.
  explicit MeshInput(const std::vector<std::string>& paths, int texcoord = 0);
  explicit MeshInput(const std::string& path) : MeshInput(std::vector<std::string>{path}) {}
  // Takes files that were read already, at least one.
  explicit MeshInput(std::vector<MeshFile> files);

  // The first file.
  const std::string& path() const { return parts_.front().file.path; }
  const MeshFile& file() const { return parts_.front().file; }
  std::vector<const MeshFile*> Files() const;
  const Triangulation& triangulation() const { return parts_.front().triangulation; }  // without its mesh
  // The mesh of all files, as sent.
  const Mesh& mesh() const { return mesh_; }
  // A view of mesh(), valid as long as this object lives.
  MeshView view() const;

  // Per corner 3 f + k of view(): the id of its UV, -1 without UV. Empty if no file has UV. Corners of one vertex with
  // equal ids have equal UV, so an edge whose two faces have the same ids at both ends is not a seam of the file.
  std::vector<std::int32_t> CornerTexcoords() const;
  // The UV of the corners, 6 numbers a face, v upwards; (0, 0) for corners without UV.
  std::vector<double> CornerUv() const;
  // The colours of the corners (client/files/vertex_colors.h), three a face, white in files without colours; empty if
  // no file has colours. Throws FILE_MALFORMED.
  std::vector<CornerColor> CornerColors() const;
  // Per face: the id of its material, -1 without material. Files never share ids. Empty if no file has materials.
  std::vector<std::int32_t> FaceMaterials() const;
  // Names by the ids of FaceMaterials(). Different files may have equal names.
  std::vector<std::string> MaterialNames() const;

  // Colours by the ids of FaceMaterials(): red, green and blue from 0 to 1; grey if the file has no colours.
  std::vector<std::array<double, 3>> MaterialColors() const;

  // Makes an atlas for every part of this kind that has faces, in the order of the files and of the parts in each file.
  // Faces of a file outside all parts share an atlas after those of its parts. Throws OPTIONS_INVALID if a file has no
  // part of this kind.
  FaceAtlases AtlasesPer(AtlasPer per) const;
  // Per face: the weight of its material, 1 by default. Empty if `material_weights` is empty. Throws MATERIAL_UNKNOWN.
  std::vector<double> FaceWeights(const std::map<std::string, double>& material_weights) const;

  // The corners that face the seams of `list`, in the order of view() (seams.h).
  std::vector<std::int32_t> SeamCorners(const SeamList& list) const;
  // The corners that face the edges of `list` at which no seam may be added.
  std::vector<std::int32_t> UncutCorners(const SeamList& list) const;
  // Per face of view(): the piece of a polygon that the face belongs to (Triangulation::piece). Empty: every face is a
  // piece of its own.
  std::vector<std::int32_t> FacePolygons() const;
  // Ids of polygons that may not stay in one piece (Triangulation::faulty), as the files count them.
  std::vector<std::int64_t> FaultyPolygons() const;

  // The polygon of a triangle of mesh(), as the files count them.
  std::int64_t PolygonOf(std::int64_t triangle) const;
  // The error or warning with the files' own ids, 0-based: faces (polygons) and vertices as the files count them.
  Error InFileIds(const Error& error) const;
  Warning InFileIds(const Warning& warning) const;
  // Describes a "face" or "vertex", given by its id in the files, with its line if the file has lines: "face 12
  // (in.obj:345)"; if there are several files, "face 12 (face 2 of b.obj, line 345)".
  std::string Place(const char* element, std::int64_t id) const;

  // The outputs for `-o out`, one per file. If `out` is a directory, or ends in '/', they are files of the same names
  // in it; otherwise the output is `out` itself, in the format of its extension ("-" and paths in /dev get the input's
  // format, or OBJ for STL). `read_texcoord`: the UV set that was read. `texcoord`: the UV set to write; if unset, the
  // set that was read or, with Textures::kKeep, the next free one. Throws OUTPUT_UNSUPPORTED if a format cannot hold
  // the output, two files would get the same name, or `out` is not a directory for several files; FILE_UNWRITABLE if
  // the directory does not exist or cannot be written to; and the errors of CheckOutput() about images
  // (client/files/mesh_output.h).
  std::vector<OutputOptions> Outputs(const std::string& out, int read_texcoord, std::optional<int> texcoord,
                                     const TextureArguments& textures) const;
  // Returns `outputs` with redrawn images of `size` texels per side, for an atlas of `atlas_size` texels per side with
  // `padding` texels between charts. Size 0 keeps the texel density of each image. `atlas_of_face`: the atlas of each
  // face of view(); empty: one atlas.
  std::vector<OutputOptions> WithTextureSize(std::vector<OutputOptions> outputs, int size, int atlas_size, int padding,
                                             const std::vector<std::int32_t>& atlas_of_face) const;
  // Texels per side that the atlas should have to keep the texel density of the images that are redrawn for it; 0 if
  // there are none.
  int TextureSideEstimate(const std::vector<OutputOptions>& outputs) const;
  // Makes the output files; `uv` is in the order of view(). Polygons that the map tears become several faces; `torn`
  // gets the number of such polygons. Throws UV_PRECISION for double UV if a format has only float UV.
  WrittenMesh WithUv(const Uv& uv, const std::vector<OutputOptions>& outputs, std::int64_t* torn = nullptr) const;
  // A PNG file that shows the map (client/pictures/map_picture.h); angles in degrees.
  std::string Picture(const Uv& uv, double azimuth, double elevation) const;
  // A PNG file or, if `path` ends in .svg, an SVG file that shows the layout (client/pictures/uv_preview.h). `packed`:
  // whether the charts are packed into tiles.
  std::string Preview(const Uv& uv, const std::string& path, bool packed) const;

 private:
  struct Part {
    MeshFile file;
    Triangulation triangulation;  // its member `mesh` is empty, since mesh_ has the triangles
    // The ids of the file's first vertex and face in mesh_, and of its first vertex and polygon among all files.
    std::int64_t first_vertex = 0;
    std::int64_t first_face = 0;
    std::int64_t first_file_vertex = 0;
    std::int64_t first_polygon = 0;
  };

  // The results of find(part), a corner list for each part, as corners of view().
  template <typename Find>
  std::vector<std::int32_t> OfAllParts(const Find& find) const;
  ids::Renumbering ToFile() const;
  std::string OutputPath(const Part& part, const std::string& out, bool is_directory) const;

  std::vector<Part> parts_;
  Mesh mesh_;  // of all parts
};

// "face 12 (in.obj:345), vertex 7 (in.obj:8)" for the first few elements that `metadata` names by file ids; without
// `input` just "face 12, vertex 7". Empty if `metadata` names no element.
std::string Places(const std::map<std::string, std::string>& metadata, const MeshInput* input = nullptr);
// "9 faces have no area [MESH_FACE_DEGENERATE], at face 12 (in.obj:345)", on one line.
std::string ErrorLine(const Error& error, const MeshInput* input = nullptr);

// Throws planish::Error (FILE_UNWRITABLE).
void WriteOutput(const std::string& path, const std::string& bytes);
// Writes all files. If the first signal comes meanwhile, the process ends after the last file. Throws FILE_UNWRITABLE.
void WriteAll(const std::vector<OutputFile>& files, Interrupts& interrupts);
// Throws FILE_UNWRITABLE if WriteOutput() could not write to the directory of `path`. To be called before minutes are
// spent on a solve.
void CheckOutput(const std::string& path);
// Makes a directory for output, and missing directories above it. Throws FILE_UNWRITABLE.
void MakeDirectory(const std::filesystem::path& directory);

}  // namespace planish::cli
