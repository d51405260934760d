// The images on the page of a report, and the triangles that show them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "client/cli/check.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/files/base_colors.h"

namespace planish::cli {

// What the triangles of a map show.
struct MapTextures {
  std::vector<std::int32_t> of_face;  // per face of CheckedMap::mesh: of `list`, -1: none
  std::vector<BaseColor> list;        // ShownImage::image: of ReportImages, -1: none that can be shown
  // What the list's colours are multiplied by, three a face, if the file has colours of vertices.
  std::vector<CornerColor> colors;

  bool empty() const { return list.empty() && colors.empty(); }
};

class ReportImages {
 public:
  // The images may have this many bytes together, and texels per side; if they have more, all of them are shown smaller
  // by the same power of two. (In the page they take a third more, as base64.)
  static constexpr std::size_t kMostBytes = std::size_t{32} << 20;
  static constexpr int kMostSide = 4096;

  // The images of `input` that materials read with the set `texcoord`, for `map`, the file's own map. Images that
  // cannot be read are named in the page. `colors_suffice`: colours of vertices count even if there are no images.
  // `allow_outside`: whether images may lie outside of the files' folders.
  MapTextures Of(const MeshInput& input, const CheckedMap& map, int texcoord, bool colors_suffice = false,
                 bool allow_outside = false);
  // The images that the files `written` have for `map`, whose triangles may have another order there.
  MapTextures OfWritten(const MeshInput& written, const CheckedMap& map, int texcoord);

  bool empty() const { return images_.empty(); }

  // Describes the images in `page` ("images"), and returns the elements of the page that hold their bytes.
  // Throws planish::Error if an image that must be shown smaller is damaged.
  std::string Write(Json* page);

 private:
  struct Image {
    std::string name, bytes;
    int width = 0, height = 0;  // in the page
    int file_width = 0, file_height = 0;
    std::string type;  // "image/png"
    bool is_color = true;
  };

  std::vector<BaseColor> Read(const MeshInput& input, int texcoord, bool allow_outside);
  std::int64_t Add(const std::string& name, const absl::StatusOr<std::string>& bytes, bool is_color);
  void Shrink(int divisor);

  std::vector<Image> images_;
  std::vector<std::string> notes_;  // about images that cannot be shown
};

}  // namespace planish::cli
