// Large immutable byte arrays that are passed between threads and processes as descriptors, without copying.
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
  // Copies `bytes` into anonymous memory that is sealed against changes. RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
  static absl::StatusOr<BlobPtr> Copy(std::string_view bytes);

  // Maps `file`, one of our own files, which nobody may change from now on.
  static absl::StatusOr<BlobPtr> Map(Descriptor file);

  // Maps `memory`, which came from a process that is not trusted. INVALID_ARGUMENT unless it is memory that is sealed
  // against changes, so that reading can neither fail nor see the bytes change.
  static absl::StatusOr<BlobPtr> MapSealed(Descriptor memory);

  ~Blob();
  Blob(const Blob&) = delete;
  Blob& operator=(const Blob&) = delete;

  std::string_view bytes() const { return {data_, size_}; }
  // Releases this process's pages of the bytes until they are read again.
  void DropPages() const;
  // The descriptor of the bytes, to be passed to another process. The blob keeps ownership.
  int descriptor() const { return descriptor_.get(); }

 private:
  friend class BlobWriter;

  Blob(Descriptor descriptor, const char* data, std::size_t size)
      : descriptor_(std::move(descriptor)), data_(data), size_(size) {}

  const Descriptor descriptor_;
  const char* const data_;
  const std::size_t size_;
};

// Bytes that are written in place before they become a Blob. Not thread-safe.
class BlobWriter {
 public:
  // `size` zeros, with their memory reserved. RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
  static absl::StatusOr<BlobWriter> Make(std::size_t size);
  BlobWriter(BlobWriter&& other) noexcept;
  BlobWriter& operator=(BlobWriter&&) = delete;
  ~BlobWriter();

  char* data() { return data_; }
  std::size_t size() const { return size_; }

  // The written bytes, sealed against changes. Nothing can be written afterwards. Call it once.
  absl::StatusOr<BlobPtr> Finish();

 private:
  BlobWriter(Descriptor memory, char* data, std::size_t size) : memory_(std::move(memory)), data_(data), size_(size) {}
  void Unmap();

  Descriptor memory_;
  char* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace planish
