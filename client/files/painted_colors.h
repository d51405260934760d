// Paints vertex colours into an image, unless input and output are glTF: there GltfMerge paints them, by material. Used
// only in client/files.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/files/mesh_output.h"
#include "client/files/writers.h"

namespace planish {

// Whether the functions below make an image of vertex colours for this output: options.textures.bake_colors with
// TextureMode::kTransfer, and the input or the output is no glTF.
bool PaintsColors(const MeshFile& file, const OutputOptions& options);

// Checks before there is a map. INVALID_ARGUMENT: OUTPUT_UNSUPPORTED for formats without a place for the image's name,
// for an OBJ or PLY on stdout, and for an OBJ with materials of its own.
absl::Status CheckPainting(const MeshFile& file, const OutputOptions& options);

// Estimates the side of the image as EstimateTextureSide() (mesh_output.h) does; 0 without vertex colours.
absl::StatusOr<double> EstimatePaintedSide(const MeshFile& file, double total_area);

// The vertex colours, painted into a PNG in the new map. A file without vertex colours gives an empty string and a
// warning. OUTPUT_UNSUPPORTED if the map has several tiles.
absl::StatusOr<std::string> PaintColors(const MeshFile& file, const WrittenPolygons& written,
                                        const OutputOptions& options, std::vector<OutputWarning>* warnings);

// Adds the image to `result`, whose last file is the OBJ or PLY, and makes that file refer to the image: an OBJ gets a
// material file; a PLY gets a comment TextureFile, which MeshLab reads.
void AddPaintedImage(const MeshFile& file, const OutputOptions& options, std::string png, WrittenMesh* result);

}  // namespace planish
