#include "server/link/mesh_elements.h"

#include <algorithm>
#include <climits>
#include <map>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr int kMostTiles = 100;
constexpr float kLowestWeight = 0.01F, kHighestWeight = 100;

absl::Status Invalid(const std::string& field, const std::string& message,
                     std::map<std::string, std::string> metadata = {}) {
  metadata["field"] = field;
  return MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID", absl::StrCat(field, ": ", message), metadata);
}

class Decoder {
 public:
  Decoder(const v1::MeshElements& elements, const v1::UnwrapOptions& options, std::optional<std::int64_t> num_faces)
      : elements_(elements), options_(options), num_faces_(num_faces) {}

  absl::StatusOr<MeshElements> Decode() const {
    MeshElements decoded;
    PLANISH_ASSIGN_OR_RETURN(decoded.seam_corners, Corners("seam_corners", elements_.seam_corners()));
    PLANISH_ASSIGN_OR_RETURN(decoded.uncut_corners, Corners("uncut_corners", elements_.uncut_corners()));
    PLANISH_ASSIGN_OR_RETURN(decoded.face_polygon, Polygons(elements_.face_polygon()));
    PLANISH_ASSIGN_OR_RETURN(decoded.face_atlas, Atlases(elements_.face_atlas()));
    PLANISH_ASSIGN_OR_RETURN(decoded.face_weights, Weights(elements_.face_weights()));
    return decoded;
  }

 private:
  // Unpacks numbers. Unsigned numbers of 2^31 and more become negative, and so are out of every range.
  template <typename Number>
  static absl::StatusOr<std::vector<Number>> Numbers(const std::string& field, std::string_view bytes) {
    if (bytes.size() % sizeof(Number) != 0) {
      return Invalid(field, absl::StrCat(bytes.size(), " bytes are no multiple of ", sizeof(Number)));
    }
    std::vector<Number> numbers(bytes.size() / sizeof(Number));
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      std::uint32_t value = 0;
      for (std::size_t k = 0; k < 4; ++k) value |= std::uint32_t{static_cast<unsigned char>(bytes[4 * i + k])} << 8 * k;
      numbers[i] = std::bit_cast<Number>(value);
    }
    return numbers;
  }

  absl::StatusOr<std::vector<std::int32_t>> Corners(const std::string& field, std::string_view bytes) const {
    PLANISH_ASSIGN_OR_RETURN(std::vector<std::int32_t> corners, Numbers<std::int32_t>(field, bytes));
    const std::int64_t end = num_faces_ ? 3 * *num_faces_ : std::int64_t{INT32_MAX} + 1;
    const auto wrong = std::find_if(corners.begin(), corners.end(), [&](std::int32_t c) { return c < 0 || c >= end; });
    if (wrong == corners.end()) return corners;
    const std::string corner = absl::StrCat(static_cast<std::uint32_t>(*wrong));
    return Invalid(field,
                   absl::StrCat("there is no corner ", corner,
                                num_faces_ ? absl::StrCat(": the mesh has ", *num_faces_, " triangles, so corners 0 to ",
                                                          end - 1)
                                           : std::string()),
                   {{"corner", corner}});
  }

  // Decodes a list of one number for each triangle.
  template <typename Number>
  absl::StatusOr<std::vector<Number>> OfFaces(const std::string& field, std::string_view bytes) const {
    PLANISH_ASSIGN_OR_RETURN(std::vector<Number> numbers, Numbers<Number>(field, bytes));
    if (numbers.empty() || !num_faces_ || std::ssize(numbers) == *num_faces_) return numbers;
    return Invalid(field, absl::StrCat(numbers.size(), " numbers for a mesh of ", *num_faces_, " triangles"));
  }

  absl::StatusOr<std::vector<std::int32_t>> Polygons(std::string_view bytes) const {
    PLANISH_ASSIGN_OR_RETURN(std::vector<std::int32_t> polygons, OfFaces<std::int32_t>("face_polygon", bytes));
    for (std::size_t f = 0; f < polygons.size(); ++f) {
      if (polygons[f] >= 0 && polygons[f] < std::ssize(polygons)) continue;
      return Invalid("face_polygon",
                     absl::StrCat("there is no polygon ", static_cast<std::uint32_t>(polygons[f]), ": ", polygons.size(),
                                  " triangles make at most that many polygons, numbered from 0"),
                     {{"face", absl::StrCat(f)}});
    }
    return polygons;
  }

  absl::Status GoesWithOptions(const std::string& field, std::string_view bytes) const {
    if (bytes.empty()) return absl::OkStatus();
    if (options_.pack() == v1::PACK_OFF) return Invalid(field, "face_atlas needs packing, and pack is off");
    if (options_.seams() != v1::SEAMS_NONE) return absl::OkStatus();
    return Invalid(field, "with SEAMS_NONE the mesh is one chart, which fills its tile");
  }

  absl::StatusOr<std::vector<std::int32_t>> Atlases(std::string_view bytes) const {
    PLANISH_RETURN_IF_ERROR(GoesWithOptions("face_atlas", bytes));
    PLANISH_ASSIGN_OR_RETURN(std::vector<std::int32_t> atlases, OfFaces<std::int32_t>("face_atlas", bytes));
    const bool stacked = options_.atlas_layout() == v1::ATLAS_LAYOUT_STACKED;
    // A number of tiles out of range is reported by the check of the options.
    const int most = stacked ? INT32_MAX : kMostTiles / std::clamp(options_.tiles(), 1, kMostTiles);
    for (std::size_t f = 0; f < atlases.size(); ++f) {
      const std::int32_t atlas = atlases[f];
      if (atlas >= 0 && atlas < most) continue;
      const std::string number = absl::StrCat(static_cast<std::uint32_t>(atlas));
      return Invalid("face_atlas",
                     stacked ? absl::StrCat("there is no atlas ", number)
                             : absl::StrCat("there is no room for atlas ", number, ": UDIM has ", kMostTiles,
                                            " tiles here, so atlases 0 to ", most - 1,
                                            "; use fewer, or ATLAS_LAYOUT_STACKED"),
                     {{"face", absl::StrCat(f)}});
    }
    return atlases;
  }

  absl::StatusOr<std::vector<float>> Weights(std::string_view bytes) const {
    PLANISH_RETURN_IF_ERROR(GoesWithOptions("face_weights", bytes));
    PLANISH_ASSIGN_OR_RETURN(std::vector<float> weights, OfFaces<float>("face_weights", bytes));
    for (std::size_t f = 0; f < weights.size(); ++f) {
      if (weights[f] >= kLowestWeight && weights[f] <= kHighestWeight) continue;
      return Invalid("face_weights", absl::StrCat(weights[f], " is not in [0.01, 100]"), {{"face", absl::StrCat(f)}});
    }
    return weights;
  }

  const v1::MeshElements& elements_;
  const v1::UnwrapOptions& options_;
  const std::optional<std::int64_t> num_faces_;
};

}  // namespace

absl::StatusOr<MeshElements> DecodeMeshElements(const v1::MeshElements& elements, const v1::UnwrapOptions& options,
                                                std::optional<std::int64_t> num_faces) {
  return Decoder(elements, options, num_faces).Decode();
}

}  // namespace planish
