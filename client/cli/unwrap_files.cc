#include "client/cli/unwrap_files.h"

#include "client/cli/seam_edges.h"

namespace planish::cli {

UnwrapFiles::UnwrapFiles(const std::vector<std::string>& inputs, const SeamList& seams, const std::string& output,
                         int texcoord)
    : input_(inputs, texcoord), seam_corners_(input_.SeamCorners(seams)), diagonals_(input_.DiagonalCorners()) {
  if (!output.empty()) outputs_ = input_.Outputs(output, texcoord);
}

UnwrapOptions UnwrapFiles::Options(UnwrapOptions options) const {
  for (const OutputOptions& output : outputs_) {
    if (!IsFloatByNature(output.format)) continue;
    if (options.precision == Precision::kDouble) {
      throw Error(ErrorCode::kInvalidArgument, "OUTPUT_UNSUPPORTED",
                  output.path +
                      ": this format holds UV as float only; leave --precision=double out, or write .obj, "
                      ".ply or .off");
    }
    options.precision = Precision::kFloat;
  }
  return options;
}

WrittenMesh UnwrapFiles::WithResult(UnwrapResult& result) const {
  for (Warning& warning : result.report.warnings) warning = input_.InFileIds(warning);
  WrittenMesh written = input_.WithUv(result.uv, outputs_);
  for (const std::string& warning : written.warnings) {
    result.report.warnings.push_back({"UV_PRECISION", warning, {}});
  }
  return written;
}

}  // namespace planish::cli
