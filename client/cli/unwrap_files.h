// The files of one unwrap: reads the inputs, and writes the outputs with the result.
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

// The labels of a job: `labels`, and "file" with the file's name unless `labels` has that key.
std::map<std::string, std::string> JobLabels(const std::map<std::string, std::string>& labels, const std::string& file);

// What map is wanted: options for the server, and seams, atlases and weights that come from the files.
struct MapArguments {
  UnwrapOptions options;  // `seams` and `hard_edge_degrees` are equal to those of the list below
  SeamList seams;
  std::optional<AtlasPer> atlas_per;               // with kFile, several files become one mesh
  std::map<std::string, double> material_weights;  // factor of the texel density by material, in [0.01, 100]
};

class UnwrapFiles {
 public:
  // Reads the files, which become one mesh, and the seams, atlases and weights that `map` takes from them. `texcoord`:
  // the UV set to read. `output`: as for MeshInput::Outputs(); without a path nothing will be written. Throws the
  // errors of MeshInput's constructor and of MeshInput::Outputs(); MATERIAL_UNKNOWN; and OPTIONS_INVALID if the files
  // do not have the seams or atlases, if there are too many atlases, or if images cannot be redrawn for such a map.
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
  // The options for the server: `options`, with float precision if the output cannot hold double. If they have neither
  // texture size nor density, the texture size is set so that redrawn images keep their texel density. Throws
  // OUTPUT_UNSUPPORTED if `options` ask for double and the output cannot hold it.
  UnwrapOptions Options(UnwrapOptions options) const;
  // Writes the output with the UV of `result`, reads it back, and returns the written files. The quality in `result` is
  // replaced by the figures of the written bytes, as `planish check` measures them. The warnings of `result` get the
  // ids of the files, and warnings about writing are added. `on_image` is called before each image is redrawn. If a
  // stop is requested before writing begins, throws CANCELLED and writes nothing. Also throws FILE_UNWRITABLE, and
  // errors about images.
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
  int texture_side_ = 0;  // MeshInput::TextureSideEstimate()
  int padding_ = 2;
};

}  // namespace planish::cli
