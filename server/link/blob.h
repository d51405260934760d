// Large immutable bytes that pass between threads and processes as a descriptor, never as a copy.
#pragma once

#include <cstddef>
#include <memory>
#include <string_view>
#include <utility>

#include "absl/status/statusor.h"
#include "core/base/descriptor.h"

namespace planish {

class Blob;
class BlobWriter;
using BlobPtr = std::shared_ptr<const Blob>;

// Thread-safe: nothing changes after construction.
class Blob {
 public:
  // `bytes` in memory that no file system sees, sealed against any change. RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
  static absl::StatusOr<BlobPtr> Copy(std::string_view bytes);

  // The bytes behind `file`, which nobody may change from now on: a file of ours.
  static absl::StatusOr<BlobPtr> Map(Descriptor file);

  // The bytes behind `memory`, which came from a process that is not trusted. INVALID_ARGUMENT unless it is memory
  // sealed against any change, so that reading it can neither fail nor see it change.
  static absl::StatusOr<BlobPtr> MapSealed(Descriptor memory);

  ~Blob();
  Blob(const Blob&) = delete;
  Blob& operator=(const Blob&) = delete;

  std::string_view bytes() const { return {data_, size_}; }
  // Until they are read again the bytes take no memory of this process.
  void DropPages() const;
  // For handing over; stays ours.
  int descriptor() const { return descriptor_.get(); }

 private:
  friend class BlobWriter;

  Blob(Descriptor descriptor, const char* data, std::size_t size)
      : descriptor_(std::move(descriptor)), data_(data), size_(size) {}

  const Descriptor descriptor_;
  const char* const data_;
  const std::size_t size_;
};

// Bytes that are written in their place, before they become a Blob. Not thread-safe.
class BlobWriter {
 public:
  // `size` zeros, for which there is memory. RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
  static absl::StatusOr<BlobWriter> Make(std::size_t size);
  BlobWriter(BlobWriter&& other) noexcept;
  BlobWriter& operator=(BlobWriter&&) = delete;
  ~BlobWriter();

  char* data() { return data_; }
  std::size_t size() const { return size_; }

  // What was written, sealed against any change; nothing can be written afterwards. Once.
  absl::StatusOr<BlobPtr> Finish();

 private:
  BlobWriter(Descriptor memory, char* data, std::size_t size) : memory_(std::move(memory)), data_(data), size_(size) {}
  void Unmap();

  Descriptor memory_;
  char* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace planish
