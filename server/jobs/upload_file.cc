#include "server/jobs/upload_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::int64_t kReadBytes = std::int64_t{1} << 20;

}  // namespace

absl::Status WriteError(int error_number, const std::string& what) {
  const std::string message = absl::StrCat(what, ": ", std::strerror(error_number));
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:  // the process may not write files of this size
    case ENOMEM:
    case EMFILE:
    case ENFILE:
      return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", message);
    default:
      return InternalError(message);
  }
}

absl::Status UploadFile::EnsureOpen() {
  if (file_.get() >= 0) return absl::OkStatus();
  file_ = path_.empty() ? Descriptor(memfd_create("planish-upload", MFD_CLOEXEC))
                        : Descriptor(open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (file_.get() < 0) return WriteError(errno, "cannot open the file of an upload");
  return absl::OkStatus();
}

absl::Status UploadFile::Append(std::string_view bytes) {
  PLANISH_RETURN_IF_ERROR(EnsureOpen());
  PLANISH_RETURN_IF_ERROR(HashTheRest());
  std::int64_t end = size_;
  for (std::string_view rest = bytes; !rest.empty();) {
    const ssize_t count = pwrite(file_.get(), rest.data(), rest.size(), end);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      absl::Status failed = WriteError(count < 0 ? errno : ENOSPC, "cannot keep the bytes of an upload");
      PLANISH_RETURN_IF_ERROR(CutTo(size_));
      return failed;
    }
    rest.remove_prefix(static_cast<std::size_t>(count));
    end += count;
  }
  hash_before_ = hash_;
  size_before_ = size_;
  hash_.Update(bytes);
  hashed_ = size_ = end;
  return absl::OkStatus();
}

absl::Status UploadFile::UndoAppend() {
  PLANISH_RETURN_IF_ERROR(CutTo(size_before_));
  hash_ = hash_before_;
  hashed_ = size_ = size_before_;
  return absl::OkStatus();
}

absl::StatusOr<std::string> UploadFile::Digest() {
  PLANISH_RETURN_IF_ERROR(EnsureOpen());
  PLANISH_RETURN_IF_ERROR(HashTheRest());
  return hash_.Digest();
}

absl::StatusOr<BlobPtr> UploadFile::Map() {
  PLANISH_RETURN_IF_ERROR(EnsureOpen());
  Descriptor copy(fcntl(file_.get(), F_DUPFD_CLOEXEC, 0));
  if (copy.get() < 0) return WriteError(errno, "cannot map the bytes of an upload");
  return Blob::Map(std::move(copy));
}

void UploadFile::Rest() {
  if (!path_.empty()) file_ = Descriptor();
}

absl::Status UploadFile::CutTo(std::int64_t size) {
  if (ftruncate(file_.get(), size) == 0) return absl::OkStatus();
  return InternalError(absl::StrCat("cannot cut the file of an upload: ", std::strerror(errno)));
}

absl::Status UploadFile::HashTheRest() {
  if (hashed_ == size_) return absl::OkStatus();
  std::vector<char> buffer(static_cast<std::size_t>(std::min(kReadBytes, size_ - hashed_)));
  while (hashed_ < size_) {
    const auto wanted = std::min(static_cast<std::int64_t>(buffer.size()), size_ - hashed_);
    const ssize_t count = pread(file_.get(), buffer.data(), static_cast<std::size_t>(wanted), hashed_);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      return InternalError(absl::StrCat("cannot read the file of an upload: ",
                                        count < 0 ? std::strerror(errno) : "it is shorter than it was"));
    }
    hash_.Update({buffer.data(), static_cast<std::size_t>(count)});
    hashed_ += count;
  }
  return absl::OkStatus();
}

}  // namespace planish
