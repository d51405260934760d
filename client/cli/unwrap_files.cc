#include "client/cli/unwrap_files.h"

#include <algorithm>
#include <atomic>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/cli/check.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "client/files/mesh_file.h"
#include "client/src/errors.h"
#include "core/base/thread_team.h"

namespace planish::cli {

namespace {

// Most bytes of a label's value.
constexpr std::size_t kMaxLabelBytes = 256;

// The last `most` bytes of `text`, without a partial character at the beginning.
std::string LastBytes(const std::string& text, std::size_t most) {
  if (text.size() <= most) return text;
  std::size_t begin = text.size() - most;
  while (begin < text.size() && (static_cast<unsigned char>(text[begin]) & 0xC0) == 0x80) ++begin;
  return text.substr(begin);
}

}  // namespace

std::map<std::string, std::string> JobLabels(const std::map<std::string, std::string>& labels,
                                             const std::string& file) {
  std::map<std::string, std::string> all = {{"file", LastBytes(ValidUtf8(file), kMaxLabelBytes)}};
  for (const auto& [key, value] : labels) all[ValidUtf8(key)] = ValidUtf8(value);
  return all;
}

UnwrapFiles::UnwrapFiles(const std::vector<std::string>& inputs, int texcoord, const MapArguments& map,
                         const OutputArguments& output)
    : input_(inputs, texcoord),
      texcoord_(texcoord),
      seam_corners_(input_.SeamCorners(map.seams)),
      uncut_corners_(input_.UncutCorners(map.seams)),
      polygons_(input_.FacePolygons()) {
  if (map.atlas_per) {
    constexpr std::size_t kMaxTiles = 100;
    atlases_ = input_.AtlasesPer(*map.atlas_per);
    const std::size_t tiles = atlases_.names.size() * static_cast<std::size_t>(std::max(1, map.options.tiles));
    if (map.options.atlas_layout == AtlasLayout::kUdim && tiles > kMaxTiles) {
      throw Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
                  std::string("--atlas-per=") + ToString(*map.atlas_per) + ": " + input_.path() + " makes " +
                      Counted(static_cast<std::int64_t>(atlases_.names.size()), "atlas", "atlases") + ", which take " +
                      std::to_string(tiles) + " tiles; UDIM has " + std::to_string(kMaxTiles) +
                      " here. --atlas-layout=stacked has no such limit",
                  {{"field", "face_atlas"}});
    }
  }
  for (const double weight : input_.FaceWeights(map.material_weights)) {
    weights_.push_back(static_cast<float>(weight));
  }
  if (output.path.empty()) return;
  outputs_ = input_.Outputs(output.path, texcoord, output.texcoord, output.textures);
  asked_texture_size_ = map.options.texture_size;
  padding_ = map.options.padding.value_or(2);
  texture_side_ = input_.TextureSideEstimate(outputs_);
  if (texture_side_ > 0 && (!map.options.pack || map.options.tiles > 1)) {
    throw Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
                input_.path() + ": its images move into the new map, which must be one tile for each atlas: " +
                    (map.options.pack ? "leave --tiles out" : "leave --pack=off out") +
                    ", or give --textures=keep or --textures=drop",
                {{"field", "textures"}});
  }
}

MeshView UnwrapFiles::view() const {
  return input_.view()
      .WithSeamCorners(seam_corners_)
      .WithUncutCorners(uncut_corners_)
      .WithFacePolygons(polygons_)
      .WithFaceAtlas(atlases_.of_face)
      .WithFaceWeights(weights_);
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
  if (options.texture_size == 0 && options.texels_per_unit == 0) options.texture_size = texture_side_;
  return options;
}

namespace {

// The first few ids, in the format of metadata: "12,40".
std::string FirstIds(const std::vector<std::int64_t>& ids) {
  constexpr std::size_t kMostNamed = 16;
  std::string text;
  for (std::size_t i = 0; i < std::min(ids.size(), kMostNamed); ++i) {
    text += (i == 0 ? "" : ",") + std::to_string(ids[i]);
  }
  return text;
}

void WarnOfCutPolygons(const std::vector<std::int64_t>& faulty, std::int64_t torn, std::vector<Warning>* warnings) {
  if (faulty.empty()) return;
  const auto count = static_cast<std::int64_t>(faulty.size());
  warnings->push_back(
      {"POLYGON_CUT",
       Counted(count, "face crosses itself, or passes", "faces cross themselves, or pass") +
           " through a vertex twice, and may be cut: " +
           (torn == 0 ? std::string("the map holds each in one piece all the same")
                      : Counted(torn, "face is", "faces are") + " written as several"),
       {{"count", std::to_string(count)}, {"faces", FirstIds(faulty)}, {"written_as_several", std::to_string(torn)}}});
}

// Replaces the quality in `report`, which the server measured on the UV that it sent, by figures measured on the
// written files. Adds a warning if the written map has more faults.
void JudgeWritten(const MeshInput& written, const std::string& path, Report* report) {
  MapCheckOptions options;
  options.texture_size = std::max(report->atlas.texture_size, 1);
  options.tiles = std::max(report->atlas.tiles, 1);
  options.with_spacing = false;
  ThreadTeam team(static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 64U)));
  const CheckedMap map = CheckMapOf(written, options, {&team});
  const MapCheck& check = map.check;
  Quality& quality = report->quality;
  // Charts that are unpacked or in stacked atlases overlap on purpose, which only the server can tell.
  const bool is_flat_atlas = report->atlas.pack && report->atlas.layout != AtlasLayout::kStacked;
  const std::int64_t overlapping = is_flat_atlas ? check.overlaps.pairs : quality.overlapping;
  const auto without_uv = static_cast<std::int64_t>(map.without_uv.size() + map.not_finite.size());
  if (check.flipped > quality.flipped || check.degenerate > quality.degenerate || overlapping > quality.overlapping ||
      without_uv > 0) {
    report->warnings.push_back(
        {"WRITTEN_MAP_DIFFERS",
         path + ": the file does not hold the map as it was computed: " + std::to_string(check.flipped) + " flipped, " +
             std::to_string(check.degenerate) + " degenerate triangles, " + std::to_string(overlapping) +
             " overlapping pairs and " + std::to_string(without_uv) + " triangles without UV as written, " +
             std::to_string(quality.flipped) + ", " + std::to_string(quality.degenerate) + ", " +
             std::to_string(quality.overlapping) + " and 0 as computed",
         {}});
  }
  quality.flipped = check.flipped;
  quality.degenerate = check.degenerate + without_uv;
  quality.overlapping = overlapping;
  quality.stretch_l2 = check.stretch_l2;
  quality.angle_error_mean_deg = check.angle_error_mean_deg;
  quality.angle_error_max_deg = check.angle_error_max_deg;
  quality.seam_length = check.seam_length;
  quality.visible_seam_length = check.seams.visible_length;
  quality.seam_turn_deg = check.seams.turn_deg;
  quality.seam_symmetry = check.seams.symmetry;
  if (is_flat_atlas) quality.packing_efficiency = check.packing_efficiency;
}

}  // namespace

std::vector<OutputFile> UnwrapFiles::WriteResult(UnwrapResult& result,
                                                 const std::function<void(const ImageProgress&)>& on_image,
                                                 const std::stop_token& stop) const {
  for (Warning& warning : result.report.warnings) warning = input_.InFileIds(warning);
  std::int64_t torn = 0;
  std::atomic<bool> is_stopped = false;
  const std::stop_callback on_stop(stop, [&is_stopped] { is_stopped = true; });
  std::vector<OutputOptions> outputs = input_.WithTextureSize(
      outputs_, asked_texture_size_, result.report.atlas.texture_size, padding_, atlases_.of_face);
  for (OutputOptions& output : outputs) {
    output.textures.stop = &is_stopped;
    output.textures.on_image = on_image;
  }
  WrittenMesh written = input_.WithUv(result.uv, outputs, &torn);
  if (is_stopped) throw Error(ErrorCode::kCancelled, "CANCELLED", "interrupted");
  for (const OutputWarning& warning : written.warnings) {
    result.report.warnings.push_back({warning.reason, warning.message, {}});
  }
  WarnOfCutPolygons(input_.FaultyPolygons(), torn, &result.report.warnings);
  for (const OutputFile& file : written.files) WriteOutput(file.path, file.bytes);
  std::vector<MeshFile> again;
  for (const OutputOptions& output : outputs_) {
    const auto file = std::find_if(written.files.begin(), written.files.end(),
                                   [&](const OutputFile& each) { return each.path == output.path; });
    if (file == written.files.end()) continue;
    absl::StatusOr<MeshFile> read = ReadMeshBytes(file->path, output.format, file->bytes, {output.texcoord});
    if (!read.ok()) throw ErrorFrom(read.status());
    again.push_back(*std::move(read));
  }
  if (!again.empty()) JudgeWritten(MeshInput(std::move(again)), outputs_.front().path, &result.report);
  return std::move(written.files);
}

}  // namespace planish::cli
