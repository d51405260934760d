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

// `labels` as a job on this file has them: with "file", the file's name, unless they have it.
std::map<std::string, std::string> JobLabels(const std::map<std::string, std::string>& labels, const std::string& file);

// The map that is wanted: options for the server, and seams, atlases and weights that come from the files.
struct MapArguments {
  UnwrapOptions options;  // seams and hard_edge_degrees as in `seams`
  SeamList seams;
  std::optional<AtlasPer> atlas_per;               // with kFile several files are one mesh
  std::map<std::string, double> material_weights;  // times the texels per length, in [0.01, 100]
};

class UnwrapFiles {
 public:
  // Reads the files, which become one mesh, and the seams, atlases and weights that `map` takes from them. `texcoord`
  // and `output` as for MeshInput::Outputs; without a path nothing will be written. Throws what that and the
  // constructor of MeshInput throw, OPTIONS_INVALID for seams and atlases that the files do not have or that are too
  // many, and for maps that images cannot be moved into; and MATERIAL_UNKNOWN.
  UnwrapFiles(const std::vector<std::string>& inputs, int texcoord, const MapArguments& map,
              const OutputArguments& output);

  const MeshInput& input() const { return input_; }
  // The set of UV that is read, of a glTF.
  int texcoord() const { return texcoord_; }
  // The files to write; empty without a path.
  const std::vector<OutputOptions>& outputs() const { return outputs_; }
  // The mesh with the seams, atlases and weights that the files give, its polygons whole; lives as long as this object.
  MeshView view() const;
  // The names of the atlases by their numbers; empty without --atlas-per.
  const std::vector<std::string>& atlas_names() const { return atlases_.names; }
  // The options for the server: `options`, with float precision if the output cannot hold double, and, unless they have
  // a texture size or density, with the texture size that keeps the texel density of the images that move. Throws
  // OUTPUT_UNSUPPORTED if `options` ask for double and the output cannot hold it.
  UnwrapOptions Options(UnwrapOptions options) const;
  // Writes the output with the UV of `result`, and reads it back. The quality in `result` is replaced by the figures of
  // the written bytes, as `planish check` measures them. Its warnings get the ids of the files, and new warnings about
  // writing are added. `on_image` is called before each image is moved. After a stop request nothing is written. Throws
  // FILE_UNWRITABLE, CANCELLED, and errors about images.
  std::vector<OutputFile> WriteResult(UnwrapResult& result,
                                      const std::function<void(const ImageProgress&)>& on_image = {},
                                      const std::stop_token& stop = {}) const;

 private:
  MeshInput input_;
  int texcoord_;
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
