// Reads image files that a model refers to, and makes new ones. Used only in client/files.
#pragma once

#include <functional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_output.h"
#include "client/texture/image.h"
#include "client/texture/texture_baker.h"

namespace planish {

// The bytes of the image file `name` beside the model at `model`. FILE_UNREADABLE, or IMAGE_OUTSIDE if it is outside of
// the model's folder and !allow_outside.
absl::StatusOr<std::string> ReadImageFile(const std::string& model, const std::string& name, bool allow_outside);

// Adds to an error of an image the advice to keep or drop the textures. Returns OK, CANCELLED and IMAGE_OUTSIDE
// unchanged.
absl::Status WithTextureAdvice(const absl::Status& status);

// An image to resample.
struct TextureBake {
  std::string name;  // for people
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool nearest = false;
  BakeOptions options;
  std::vector<TextureTriangle> triangles;
  std::vector<double> areas;         // on the surface, one for each triangle
  std::vector<CornerFrames> frames;  // three for each triangle, or empty
  std::vector<CornerColor> colors;   // three for each triangle, or empty
};

// Decodes, resamples and encodes one image, in the same format with the same channels. Warns with TEXTURE_SIZE. Errors
// of the image; RESOURCE_EXHAUSTED, TEXTURE_MEMORY; CANCELLED.
absl::StatusOr<std::string> BakeImage(std::string bytes, const TextureBake& bake, const TextureOptions& options,
                                      std::vector<OutputWarning>* warnings);

// One of several parts from which an image is drawn: an old image, or a constant.
struct TexturePart {
  std::function<absl::StatusOr<std::string>()> read;  // the bytes of the old image; null: white
  TextureBake bake;                                   // its factor and offset turn white into a constant
};

// Draws all parts into one image, called `name`. It has the kind of the old images if they are all of one kind, else
// it is a PNG. `has_alpha`: it has an alpha channel. Its texels are as dense as those of the densest old image; with
// constants or painted colours, it is at least as large as the atlas was packed for. Warnings and errors are those of
// BakeImage().
absl::StatusOr<std::string> BakeParts(std::vector<TexturePart> parts, const std::string& name, bool has_alpha,
                                      const TextureOptions& options, std::vector<OutputWarning>* warnings);

// The side of the image in which vertex colours keep their detail: TextureSideOf() for two texels per edge of the mesh.
double SideOfVertexColors(std::span<const TextureTriangle> triangles, std::span<const double> areas);

// Names of the new image files of one output, beside it: "OUTPUT_IMAGE.png", without repetitions.
class TextureFileNames {
 public:
  // `taken` are files that the model reads and that must not be overwritten.
  TextureFileNames(const std::string& output, const std::vector<std::string>& taken);
  // The path of a new file for the image called `image`.
  std::string Next(const std::string& image, ImageKind kind);
  // The path of a new material file, "OUTPUT.mtl".
  std::string NextMaterialFile();

 private:
  std::string Unused(const std::string& name, const std::string& extension);

  std::string output_;
  std::set<std::string> taken_;
};

}  // namespace planish
