#include "client/cli/unwrap_files.h"

#include "client/cli/json.h"
#include "client/cli/seam_edges.h"

namespace planish::cli {
namespace {

// What the value of a label may have.
constexpr std::size_t kMaxLabelBytes = 256;

// The end of a text that is too long, from the beginning of a character on.
std::string LastBytes(const std::string& text, std::size_t most) {
  if (text.size() <= most) return text;
  std::size_t begin = text.size() - most;
  while (begin < text.size() && (static_cast<unsigned char>(text[begin]) & 0xC0) == 0x80) ++begin;
  return text.substr(begin);
}

}  // namespace

std::map<std::string, std::string> JobLabels(const Arguments& arguments, const std::string& file) {
  std::map<std::string, std::string> labels = {{"file", LastBytes(ValidUtf8(file), kMaxLabelBytes)}};
  for (const auto& [key, value] : arguments.labels) labels[ValidUtf8(key)] = ValidUtf8(value);
  return labels;
}

UnwrapFiles::UnwrapFiles(const std::vector<std::string>& inputs, const SeamList& seams, const std::string& output,
                         int texcoord, int output_texcoord)
    : input_(inputs, texcoord), seam_corners_(input_.SeamCorners(seams)), uncut_corners_(input_.UncutCorners(seams)) {
  if (!output.empty()) outputs_ = input_.Outputs(output, output_texcoord);
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
  for (const OutputWarning& warning : written.warnings) {
    result.report.warnings.push_back({warning.reason, warning.message, {}});
  }
  return written;
}

}  // namespace planish::cli
