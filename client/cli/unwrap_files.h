// One unwrap seen from its files: what is sent to the server, and the way of the result into the output.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/mesh_input.h"
#include "client/cli/seam_list.h"
#include "planish/client.h"

namespace planish::cli {

// Those of a job on this file: what the arguments say, and the file's name unless they say something else of "file".
std::map<std::string, std::string> JobLabels(const Arguments& arguments, const std::string& file);

class UnwrapFiles {
 public:
  // Reads the files, which become one mesh, and the seams that `seams` takes from them. `output` as for
  // MeshInput::Outputs; empty: nothing will be written. Throws what that and the constructor of MeshInput throw, and
  // OPTIONS_INVALID for seams that the files do not have.
  UnwrapFiles(const std::vector<std::string>& inputs, const SeamList& seams, const std::string& output, int texcoord,
              int output_texcoord);

  const MeshInput& input() const { return input_; }
  // The mesh with the seams that the files give, its polygons whole; lives as long as this object.
  MeshView view() const { return input_.view().WithSeamCorners(seam_corners_).WithUncutCorners(uncut_corners_); }
  // What to ask the server for: `options`, in float where that is all that the output can hold. Throws
  // OUTPUT_UNSUPPORTED where `options` insist on double.
  UnwrapOptions Options(UnwrapOptions options) const;
  // The output with the UV of `result`, whose warnings become those of the files: in their own ids, and with what was
  // noticed on the way. Writes nothing.
  WrittenMesh WithResult(UnwrapResult& result) const;

 private:
  MeshInput input_;
  std::vector<std::int32_t> seam_corners_;
  std::vector<std::int32_t> uncut_corners_;
  std::vector<OutputOptions> outputs_;
};

}  // namespace planish::cli
