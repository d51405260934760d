#include "server/link/blob.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr int kAllSeals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;

absl::Status Failed(const char* what) {
  const int error = errno;
  const std::string message = absl::StrCat(what, ": ", std::strerror(error));
  if (error == ENOMEM || error == ENOSPC || error == EFBIG || error == EMFILE || error == ENFILE) {
    return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", message);
  }
  return InternalError(message);
}

}  // namespace

absl::StatusOr<BlobPtr> Blob::Copy(std::string_view bytes) {
  PLANISH_ASSIGN_OR_RETURN(BlobWriter writer, BlobWriter::Make(bytes.size()));
  if (!bytes.empty()) std::memcpy(writer.data(), bytes.data(), bytes.size());
  return writer.Finish();
}

absl::StatusOr<BlobPtr> Blob::Map(Descriptor file) {
  // lseek() tells the size. The C library implements fstat() by a system call that a worker's sandbox refuses.
  const off_t end = lseek(file.get(), 0, SEEK_END);
  if (end < 0) return Failed("cannot tell the size of bytes");
  const auto size = static_cast<std::size_t>(end);
  void* data = nullptr;
  if (size > 0) {
    data = mmap(nullptr, size, PROT_READ, MAP_SHARED, file.get(), 0);
    if (data == MAP_FAILED) return Failed("cannot map bytes into memory");
  }
  return BlobPtr(new Blob(std::move(file), static_cast<const char*>(data), size));
}

absl::StatusOr<BlobPtr> Blob::MapSealed(Descriptor memory) {
  const int seals = fcntl(memory.get(), F_GET_SEALS);
  if (seals < 0 || (seals & kAllSeals) != kAllSeals) {
    return MakeError(absl::StatusCode::kInvalidArgument, "INTERNAL", "a descriptor that is no sealed memory");
  }
  return Map(std::move(memory));
}

Blob::~Blob() {
  if (size_ > 0) munmap(const_cast<char*>(data_), size_);
}

void Blob::DropPages() const {
  if (size_ > 0) madvise(const_cast<char*>(data_), size_, MADV_DONTNEED);
}

absl::StatusOr<BlobWriter> BlobWriter::Make(std::size_t size) {
  Descriptor memory(memfd_create("planish-blob", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (memory.get() < 0) return Failed("memfd_create");
  if (size == 0) return BlobWriter(std::move(memory), nullptr, 0);
  // Memory is reserved now, while that can fail cleanly: a page that is missing when it is written to would cause a
  // signal.
  if (fallocate(memory.get(), 0, 0, static_cast<off_t>(size)) != 0) return Failed("no memory for shared bytes");
  void* const data = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, memory.get(), 0);
  if (data == MAP_FAILED) return Failed("cannot map shared bytes");
  return BlobWriter(std::move(memory), static_cast<char*>(data), size);
}

BlobWriter::BlobWriter(BlobWriter&& other) noexcept
    : memory_(std::move(other.memory_)),
      data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)) {}

BlobWriter::~BlobWriter() {
  Unmap();
}

void BlobWriter::Unmap() {
  if (data_ != nullptr) munmap(data_, size_);
  data_ = nullptr;
}

absl::StatusOr<BlobPtr> BlobWriter::Finish() {
  Unmap();  // memory that is mapped for writing cannot be sealed
  if (fcntl(memory_.get(), F_ADD_SEALS, kAllSeals) != 0) return Failed("cannot seal memory");
  return Blob::Map(std::move(memory_));
}

}  // namespace planish
