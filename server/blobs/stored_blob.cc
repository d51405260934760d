#include "server/blobs/stored_blob.h"

#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

class MemoryBlob : public StoredBlob {
 public:
  explicit MemoryBlob(BlobPtr bytes)
      : StoredBlob(static_cast<std::int64_t>(bytes->bytes().size())), bytes_(std::move(bytes)) {}

  const BlobPtr& memory() const override { return bytes_; }

 protected:
  absl::Status ReadRange(std::int64_t offset, std::int64_t length, std::string* bytes) const override {
    bytes->assign(bytes_->bytes().substr(static_cast<std::size_t>(offset), static_cast<std::size_t>(length)));
    return absl::OkStatus();
  }

 private:
  const BlobPtr bytes_;
};

class FileBlob : public StoredBlob {
 public:
  FileBlob(FileLayer* files, Descriptor file, std::int64_t size)
      : StoredBlob(size), files_(files), file_(std::move(file)) {}

 protected:
  absl::Status ReadRange(std::int64_t offset, std::int64_t length, std::string* bytes) const override {
    bytes->resize(static_cast<std::size_t>(length));
    return ReadFile(files_, file_.get(), offset, length, bytes->data());
  }

 private:
  FileLayer* const files_;
  const Descriptor file_;
};

}  // namespace

StoredBlobPtr StoredBlob::InMemory(BlobPtr bytes) {
  return std::make_shared<const MemoryBlob>(std::move(bytes));
}

StoredBlobPtr StoredBlob::InFile(FileLayer* files, Descriptor file, std::int64_t size) {
  return std::make_shared<const FileBlob>(files, std::move(file), size);
}

const BlobPtr& StoredBlob::memory() const {
  static const BlobPtr* const none = new BlobPtr;
  return *none;
}

absl::Status StoredBlob::ReadFile(FileLayer* files, int fd, std::int64_t offset, std::int64_t length, char* bytes) {
  while (length > 0) {
    const ssize_t count = files->Read(fd, bytes, static_cast<std::size_t>(length), offset);
    if (count < 0) return FileError("read", "a file of the store", static_cast<int>(-count));
    if (count == 0) {
      return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED", "a file of the store is shorter than it was");
    }
    bytes += count;
    offset += count;
    length -= count;
  }
  return absl::OkStatus();
}

absl::Status StoredBlob::Read(std::int64_t offset, std::int64_t length, std::string* bytes) const {
  if (offset < 0 || length < 0 || offset > size_ - length) return InternalError("a read beyond the end of a blob");
  bytes->clear();
  return length == 0 ? absl::OkStatus() : ReadRange(offset, length, bytes);
}

absl::StatusOr<std::string> StoredBlob::ReadAll() const {
  std::string bytes;
  PLANISH_RETURN_IF_ERROR(Read(0, size_, &bytes));
  return bytes;
}

}  // namespace planish
