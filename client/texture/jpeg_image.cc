#include <algorithm>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>

// jpeglib.h needs size_t and FILE.
#include <jerror.h>
#include <jpeglib.h>

#include "client/texture/image.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish::texture_internal {
namespace {

constexpr unsigned kMostMarkerBytes = 65533;
// A file of many scans over a large image takes minutes to decode; encoders write about ten.
constexpr int kMostScans = 100;

// libjpeg's errors are made to jump, so nothing with a destructor may live in the functions that are jumped out of.
struct JpegErrors {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX] = "";
};

void OnJpegError(j_common_ptr jpeg) {
  auto* const errors = reinterpret_cast<JpegErrors*>(jpeg->err);
  errors->manager.format_message(jpeg, errors->message);
  std::longjmp(errors->jump, 1);
}

// Makes the library's warnings errors, except for harmless ones: it would go on with grey where data are missing.
void OnJpegMessage(j_common_ptr jpeg, int level) {
  if (level >= 0) return;
  const int code = jpeg->err->msg_code;
  if (code == JWRN_EXTRANEOUS_DATA || code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR) return;
  OnJpegError(jpeg);
}

void OnJpegProgress(j_common_ptr jpeg) {
  auto* const input = reinterpret_cast<j_decompress_ptr>(jpeg);
  if (input->input_scan_number > kMostScans) ERREXIT(jpeg, JERR_BAD_PROGRESSION);
}

void SetErrors(JpegErrors* errors) {
  jpeg_std_error(&errors->manager);
  errors->manager.error_exit = OnJpegError;
  errors->manager.emit_message = OnJpegMessage;
}

class JpegReader {
 public:
  JpegReader(std::string_view bytes, JpegErrors* errors) : bytes_(bytes), errors_(errors) {
    SetErrors(errors);
    jpeg_.err = &errors->manager;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  bool ReadHeader() {
    if (setjmp(errors_->jump) != 0) return false;
    jpeg_create_decompress(&jpeg_);
    progress_.progress_monitor = OnJpegProgress;
    jpeg_.progress = &progress_;
    jpeg_save_markers(&jpeg_, JPEG_APP0 + 2, kMostMarkerBytes);
    jpeg_mem_src(&jpeg_, reinterpret_cast<const unsigned char*>(bytes_.data()), bytes_.size());
    jpeg_read_header(&jpeg_, TRUE);
    return true;
  }

  bool ReadTexels(std::uint8_t* texels, std::size_t row_bytes) {
    if (setjmp(errors_->jump) != 0) return false;
    jpeg_.out_color_space = jpeg_.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&jpeg_);
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = texels + std::size_t{jpeg_.output_scanline} * row_bytes;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
    return true;
  }

  const jpeg_decompress_struct& jpeg() const { return jpeg_; }

 private:
  std::string_view bytes_;
  JpegErrors* errors_;
  jpeg_progress_mgr progress_ = {};
  jpeg_decompress_struct jpeg_ = {};
};

// Writes the JPEG into *buffer, which libjpeg allocates with malloc. False: an error, whose message is in *errors.
bool WriteJpeg(const TextureImage& image, JpegErrors* errors, unsigned char** buffer, unsigned long* size) {
  jpeg_compress_struct jpeg = {};
  SetErrors(errors);
  jpeg.err = &errors->manager;
  if (setjmp(errors->jump) != 0) {
    jpeg_destroy_compress(&jpeg);
    return false;
  }
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, buffer, size);
  jpeg.image_width = static_cast<JDIMENSION>(image.header.width);
  jpeg.image_height = static_cast<JDIMENSION>(image.header.height);
  jpeg.input_components = image.header.channels;
  jpeg.in_color_space = image.header.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, kImageQuality, TRUE);
  for (int c = 0; c < jpeg.num_components; ++c) jpeg.comp_info[c].h_samp_factor = jpeg.comp_info[c].v_samp_factor = 1;
  jpeg_start_compress(&jpeg, TRUE);
  for (const TextureImage::ColorChunk& chunk : image.color_chunks) {
    if (chunk.type != "APP2") continue;
    jpeg_write_marker(&jpeg, JPEG_APP0 + 2, reinterpret_cast<const JOCTET*>(chunk.data.data()),
                      static_cast<unsigned>(chunk.data.size()));
  }
  const std::size_t row_bytes = static_cast<std::size_t>(image.header.width) * image.header.channels;
  while (jpeg.next_scanline < jpeg.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(image.texels.data()) + std::size_t{jpeg.next_scanline} * row_bytes;
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  return true;
}

absl::Status Fault(const std::string& name, const JpegErrors& errors) {
  return ImageMalformed(name, std::string("libjpeg: ") + errors.message);
}

}  // namespace

absl::StatusOr<ImageHeader> ReadJpegHeader(std::string_view bytes, const std::string& name) {
  JpegErrors errors;
  JpegReader reader(bytes, &errors);
  if (!reader.ReadHeader()) return Fault(name, errors);
  const jpeg_decompress_struct& jpeg = reader.jpeg();
  if (jpeg.jpeg_color_space == JCS_CMYK || jpeg.jpeg_color_space == JCS_YCCK) {
    return ImageUnsupported(name, "a JPEG image with CMYK colours; save it as RGB");
  }
  if (jpeg.num_components != 1 && jpeg.num_components != 3) {
    return ImageUnsupported(name,
                            "a JPEG image of " + std::to_string(jpeg.num_components) + " channels; save it as RGB");
  }
  ImageHeader header;
  header.width = static_cast<int>(jpeg.image_width);
  header.height = static_cast<int>(jpeg.image_height);
  header.channels = jpeg.num_components;
  return header;
}

bool IsJpegCutOff(std::string_view bytes) {
  constexpr unsigned kTem = 0x01, kRst0 = 0xD0, kRst7 = 0xD7, kSoi = 0xD8, kEoi = 0xD9;
  const auto byte = [bytes](std::size_t i) { return unsigned{static_cast<unsigned char>(bytes[i])}; };
  // Like libjpeg, skips all bytes up to the next marker: a scan, or bytes that belong to nothing.
  std::size_t at = 2;
  while ((at = bytes.find('\xFF', at)) != std::string_view::npos) {
    at = bytes.find_first_not_of('\xFF', at);
    if (at == std::string_view::npos) return true;
    const unsigned marker = byte(at++);
    // libjpeg refuses a second SOI.
    if (marker == kEoi || marker == kSoi) return false;
    // 0xFF followed by 0 is a byte of a scan.
    if (marker == 0 || marker == kTem || (marker >= kRst0 && marker <= kRst7)) continue;
    if (bytes.size() - at < 2) return true;
    // The length counts its own two bytes. libjpeg takes 0 and 1 for 2.
    at += std::max(256 * byte(at) + byte(at + 1), 2u);
    if (at > bytes.size()) return true;
  }
  return true;
}

absl::Status DecodeJpeg(std::string_view bytes, const std::string& name, TextureImage* image) {
  JpegErrors errors;
  JpegReader reader(bytes, &errors);
  const auto row = static_cast<std::size_t>(image->header.bytes() / image->header.height);
  if (!reader.ReadHeader() || !reader.ReadTexels(image->texels.data(), row)) return Fault(name, errors);
  for (jpeg_saved_marker_ptr marker = reader.jpeg().marker_list; marker != nullptr; marker = marker->next) {
    image->color_chunks.push_back(
        {"APP2", std::string(reinterpret_cast<const char*>(marker->data), marker->data_length)});
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> EncodeJpegImage(const TextureImage& image) {
  if (image.header.bits != 8 || image.header.has_alpha()) {
    return InternalError("JPEG has neither 16 bits nor alpha");
  }
  JpegErrors errors;
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  const bool written = WriteJpeg(image, &errors, &buffer, &size);
  std::string bytes;
  if (written) bytes.assign(reinterpret_cast<const char*>(buffer), size);
  std::free(buffer);
  if (!written) return InternalError(std::string("libjpeg: ") + errors.message);
  return bytes;
}

}  // namespace planish::texture_internal
