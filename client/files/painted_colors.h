// Vertex colours painted into an image, for files other than glTF in which materials say what is painted (GltfMerge).
// Used only in client/files.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/files/mesh_output.h"
#include "client/files/writers.h"

namespace planish {

// Whether this output has an image of vertex colours from here: options.textures.bake_colors, and the input or the
// output is no glTF.
bool PaintsColors(const MeshFile& file, const OutputOptions& options);

// Checks before there is a map. INVALID_ARGUMENT: OUTPUT_UNSUPPORTED for formats without a place for the image's name,
// for stdout, for an OBJ with materials of its own and for several atlases.
absl::Status CheckPainting(const MeshFile& file, const OutputOptions& options);

// EstimateTextureSide() (mesh_output.h).
absl::StatusOr<double> EstimatePaintedSide(const MeshFile& file, double total_area);

// The vertex colours, painted into a PNG in the new map. A file without vertex colours gives an empty string and a
// warning.
absl::StatusOr<std::string> PaintColors(const MeshFile& file, const WrittenPolygons& written,
                                        const OutputOptions& options, std::vector<OutputWarning>* warnings);

// Puts the image into files beside the last of `result`, which is the OBJ or PLY, and makes that name it: an OBJ gets a
// material file; a PLY gets a comment TextureFile, which MeshLab reads.
void AddPaintedImage(const MeshFile& file, const OutputOptions& options, std::string png, WrittenMesh* result);

}  // namespace planish
