#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>
#include <optional>

#include "client/texture/image.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish::texture_internal {
namespace {

// libpng's errors jump, so nothing with a destructor may live in the functions that are jumped out of.
struct PngErrors {
  char message[200] = "";
};

void OnPngError(png_structp png, png_const_charp message) {
  auto* const errors = static_cast<PngErrors*>(png_get_error_ptr(png));
  std::strncpy(errors->message, message, sizeof errors->message - 1);
  png_longjmp(png, 1);
}

void OnPngWarning(png_structp, png_const_charp) {}

struct PngInput {
  const char* next;
  std::size_t left;
};

void ReadPngBytes(png_structp png, png_bytep data, png_size_t size) {
  auto* const input = static_cast<PngInput*>(png_get_io_ptr(png));
  if (size > input->left) png_error(png, "the file is cut off");
  std::memcpy(data, input->next, size);
  input->next += size;
  input->left -= size;
}

void WritePngBytes(png_structp png, png_bytep data, png_size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), size);
}

void FlushPng(png_structp) {}

class PngReader {
 public:
  PngReader(std::string_view bytes, PngErrors* errors) : input_{bytes.data(), bytes.size()} {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, errors, OnPngError, OnPngWarning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) return;
    png_set_read_fn(png_, &input_, ReadPngBytes);
    // Keeps chunks that we do not need from taking much memory.
    png_set_chunk_malloc_max(png_, 8 << 20);
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
    png_set_user_limits(png_, kLargestImageSide, kLargestImageSide);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  bool ReadInfo(ImageHeader* header) {
    if (info_ == nullptr || setjmp(png_jmpbuf(png_)) != 0) return false;
    png_read_info(png_, info_);
    png_set_expand(png_);
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
    passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    header->width = static_cast<int>(png_get_image_width(png_, info_));
    header->height = static_cast<int>(png_get_image_height(png_, info_));
    header->channels = png_get_channels(png_, info_);
    header->bits = png_get_bit_depth(png_, info_);
    return true;
  }

  bool ReadTexels(std::uint8_t* texels, std::size_t row_bytes, int height) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    for (int pass = 0; pass < passes_; ++pass) {
      for (int y = 0; y < height; ++y) png_read_row(png_, texels + static_cast<std::size_t>(y) * row_bytes, nullptr);
    }
    png_read_end(png_, nullptr);
    return true;
  }

  std::size_t row_bytes() const { return png_get_rowbytes(png_, info_); }

 private:
  PngInput input_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  int passes_ = 1;
};

class PngWriter {
 public:
  PngWriter(std::string* bytes, PngErrors* errors) {
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, errors, OnPngError, OnPngWarning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ != nullptr) png_set_write_fn(png_, bytes, WritePngBytes, FlushPng);
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  bool Write(const TextureImage& image) {
    if (info_ == nullptr || setjmp(png_jmpbuf(png_)) != 0) return false;
    constexpr int kColorTypes[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                   PNG_COLOR_TYPE_RGB_ALPHA};
    const ImageHeader& header = image.header;
    png_set_IHDR(png_, info_, static_cast<png_uint_32>(header.width), static_cast<png_uint_32>(header.height),
                 header.bits, kColorTypes[header.channels - 1], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_set_compression_level(png_, 6);
    png_write_info_before_PLTE(png_, info_);
    for (const TextureImage::ColorChunk& chunk : image.color_chunks) {
      if (chunk.type.size() != 4 || chunk.type == "APP2") continue;
      png_write_chunk(png_, reinterpret_cast<png_const_bytep>(chunk.type.data()),
                      reinterpret_cast<png_const_bytep>(chunk.data.data()), chunk.data.size());
    }
    png_write_info(png_, info_);
    if (std::endian::native == std::endian::little) png_set_swap(png_);
    const std::size_t row = static_cast<std::size_t>(header.width) * header.channels * (header.bits / 8);
    for (int y = 0; y < header.height; ++y)
      png_write_row(png_, image.texels.data() + static_cast<std::size_t>(y) * row);
    png_write_end(png_, nullptr);
    return true;
  }

 private:
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

struct PngChunk {
  std::string_view type, data;
  std::size_t end;  // behind the checksum
};

// The chunk at `at`; nullopt if the bytes end before it does.
std::optional<PngChunk> ChunkAt(std::string_view bytes, std::size_t at) {
  constexpr std::size_t kAround = 12;  // length, type and checksum
  if (at > bytes.size() || bytes.size() - at < kAround) return std::nullopt;
  std::size_t size = 0;
  for (std::size_t i = 0; i < 4; ++i) size = size << 8 | static_cast<unsigned char>(bytes[at + i]);
  if (size > bytes.size() - at - kAround) return std::nullopt;
  return PngChunk{bytes.substr(at + 4, 4), bytes.substr(at + 8, size), at + kAround + size};
}

constexpr std::size_t kPngSignature = 8;  // bytes

// The chunks before the image that say what its colours mean. libpng must have read `bytes` without errors.
std::vector<TextureImage::ColorChunk> ColorChunks(std::string_view bytes) {
  std::vector<TextureImage::ColorChunk> chunks;
  std::optional<PngChunk> chunk = ChunkAt(bytes, kPngSignature);
  for (; chunk && chunk->type != "IDAT"; chunk = ChunkAt(bytes, chunk->end)) {
    for (const std::string_view kept : {"cHRM", "cICP", "gAMA", "iCCP", "sRGB"}) {
      if (chunk->type == kept) chunks.push_back({std::string(chunk->type), std::string(chunk->data)});
    }
  }
  return chunks;
}

}  // namespace

absl::StatusOr<ImageHeader> ReadPngHeader(std::string_view bytes, const std::string& name) {
  PngErrors errors;
  ImageHeader header;
  PngReader reader(bytes, &errors);
  if (!reader.ReadInfo(&header)) return ImageMalformed(name, std::string("libpng: ") + errors.message);
  return header;
}

bool IsPngCutOff(std::string_view bytes) {
  std::optional<PngChunk> chunk = ChunkAt(bytes, kPngSignature);
  while (chunk && chunk->type != "IEND") chunk = ChunkAt(bytes, chunk->end);
  return !chunk;
}

absl::Status DecodePng(std::string_view bytes, const std::string& name, TextureImage* image) {
  PngErrors errors;
  ImageHeader header;
  PngReader reader(bytes, &errors);
  const auto row = static_cast<std::size_t>(image->header.bytes() / image->header.height);
  const bool read = reader.ReadInfo(&header) && reader.row_bytes() == row &&
                    reader.ReadTexels(image->texels.data(), row, image->header.height);
  if (!read) return ImageMalformed(name, std::string("libpng: ") + errors.message);
  image->color_chunks = ColorChunks(bytes);
  return absl::OkStatus();
}

absl::StatusOr<std::string> EncodePngImage(const TextureImage& image) {
  PngErrors errors;
  std::string bytes;
  PngWriter writer(&bytes, &errors);
  if (!writer.Write(image)) return InternalError(std::string("libpng: ") + errors.message);
  return bytes;
}

}  // namespace planish::texture_internal
