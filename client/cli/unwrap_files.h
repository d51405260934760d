// One unwrap, from input files to output files.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/mesh_input.h"
#include "client/files/mesh_output.h"
#include "planish/client.h"

namespace planish::cli {

// The labels of a job on this file: those of the arguments, and "file" with the file's name unless the arguments have
// it.
std::map<std::string, std::string> JobLabels(const Arguments& arguments, const std::string& file);

class UnwrapFiles {
 public:
  // Reads the files, which become one mesh, and the seams, atlases and weights that `arguments` take from them; other
  // paths in `arguments` do not matter. `output` and `output_texcoord` as for MeshInput::Outputs; empty: nothing will
  // be written. Throws what that and the constructor of MeshInput throw, OPTIONS_INVALID for seams and atlases that the
  // files do not have or that are too many, and for maps that images cannot be moved into; and MATERIAL_UNKNOWN.
  UnwrapFiles(const std::vector<std::string>& inputs, const Arguments& arguments, const std::string& output,
              int texcoord, std::optional<int> output_texcoord);

  const MeshInput& input() const { return input_; }
  // The mesh with the seams, atlases and weights that the files give, its polygons whole; lives as long as this object.
  MeshView view() const;
  // The names of the atlases by their numbers; empty without --atlas-per.
  const std::vector<std::string>& atlas_names() const { return atlases_.names; }
  // What to ask the server for: `options`, in float where that is all that the output can hold, and with the texture
  // size that keeps the texel density of images that move, unless `options` give one. Throws OUTPUT_UNSUPPORTED where
  // `options` insist on double.
  UnwrapOptions Options(UnwrapOptions options) const;
  // Writes the output with the UV of `result`, and reads it again: the quality that `result` reports becomes that of
  // the bytes written, as `planish check` finds it. Its warnings become those of the files: in their own ids, and with
  // what was noticed on the way. `on_image` hears of each image that is moved, before; nothing is written once `stop`
  // is asked for. Throws FILE_UNWRITABLE, CANCELLED, and what is wrong with images.
  std::vector<OutputFile> WriteResult(UnwrapResult& result,
                                      const std::function<void(const ImageProgress&)>& on_image = {},
                                      const std::stop_token& stop = {}) const;

 private:
  MeshInput input_;
  std::vector<std::int32_t> seam_corners_;
  std::vector<std::int32_t> uncut_corners_;
  std::vector<std::int32_t> polygons_;
  FaceAtlases atlases_;
  std::vector<float> weights_;
  std::vector<OutputOptions> outputs_;
  int asked_texture_size_ = 0;
  int texture_side_ = 0;  // TextureSideEstimate()
  int padding_ = 2;
};

}  // namespace planish::cli
