#include "core/io/png_file.h"

#include <png.h>

#include "absl/strings/str_cat.h"

namespace planish {

absl::StatusOr<std::string> EncodePng(const Image& image) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = 0;
  const auto write = [&](void* memory) {
    return png_image_write_to_memory(&header, memory, &size, /*convert_to_8_bit=*/0, image.pixels.data(),
                                     /*row_stride=*/0, nullptr);
  };
  std::string bytes;
  // The first call only measures.
  if (write(nullptr)) {
    bytes.resize(size);
    if (write(bytes.data())) {
      bytes.resize(size);
      return bytes;
    }
  }
  return absl::InternalError(absl::StrCat("libpng: ", header.message));
}

}  // namespace planish
