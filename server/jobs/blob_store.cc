#include "server/jobs/blob_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigestBytes = 32;
constexpr char kTemporary[] = "new-";

absl::Status StorageFull(const std::string& message) {
  return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", message);
}

absl::Status Failed(const std::string& what, const std::string& path, int error) {
  const std::string message = absl::StrCat("cannot ", what, " ", path, ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT || error == EFBIG || error == ENOMEM) return StorageFull(message);
  return InternalError(message);
}

// A file that cannot be written whole does not stay.
absl::Status WriteFile(const std::string& path, std::string_view bytes) {
  const Descriptor file(open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (file.get() < 0) return Failed("create", path, errno);
  while (!bytes.empty()) {
    const ssize_t count = write(file.get(), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      const int error = errno;
      unlink(path.c_str());
      return Failed("write", path, error);
    }
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return absl::OkStatus();
}

absl::StatusOr<BlobPtr> MapFile(const std::string& path) {
  Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return Failed("open", path, errno);
  return Blob::Map(std::move(file));
}

}  // namespace

BlobStore::BlobStore(std::string directory, std::int64_t max_bytes)
    : directory_(std::move(directory)), max_bytes_(max_bytes) {}

absl::Status BlobStore::Open() {
  if (directory_.empty()) return absl::OkStatus();
  const std::lock_guard lock(mutex_);
  std::error_code error;
  std::vector<fs::path> torn;
  for (fs::recursive_directory_iterator entry(directory_, error), end; !error && entry != end; entry.increment(error)) {
    if (!entry->is_regular_file(error)) continue;
    const std::string name = entry->path().filename();
    if (name.starts_with(kTemporary)) torn.push_back(entry->path());
    if (name.size() != 2 * kDigestBytes) continue;
    const auto size = static_cast<std::int64_t>(entry->file_size(error));
    entries_[absl::HexStringToBytes(name)].bytes = size;
    bytes_ += size;
  }
  if (error) return Failed("read", directory_, error.value());
  for (const fs::path& path : torn) fs::remove(path, error);
  return absl::OkStatus();
}

absl::StatusOr<BlobPtr> BlobStore::Put(std::string_view bytes, std::string sha256) {
  if (sha256.empty()) sha256 = Sha256(bytes);
  const auto size = static_cast<std::int64_t>(bytes.size());
  std::string temporary;
  {
    const std::lock_guard lock(mutex_);
    if (entries_.contains(sha256)) return FindLocked(sha256);
    PLANISH_RETURN_IF_ERROR(CheckRoom(size));
    temporary = absl::StrCat(directory_, "/", kTemporary, next_temporary_++);
  }
  if (!directory_.empty()) {
    PLANISH_RETURN_IF_ERROR(WriteFile(temporary, bytes));
    absl::StatusOr<BlobPtr> blob = PutFile(temporary, sha256);
    std::error_code ignored;  // gone if all went well
    fs::remove(temporary, ignored);
    return blob;
  }
  PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, Blob::Copy(bytes));
  const std::lock_guard lock(mutex_);
  const auto [entry, is_new] = entries_.try_emplace(sha256);
  if (is_new) {
    entry->second = {size, {}, blob};
    bytes_ += size;
  }
  return entry->second.kept;
}

absl::StatusOr<BlobPtr> BlobStore::PutFile(const std::string& path, const std::string& sha256) {
  PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, MapFile(path));
  std::error_code error;
  if (directory_.empty()) {
    absl::StatusOr<BlobPtr> copy = Put(blob->bytes(), sha256);
    if (copy.ok()) fs::remove(path, error);
    return copy;
  }
  const std::string place = PathOf(sha256);
  const auto size = static_cast<std::int64_t>(blob->bytes().size());
  const std::lock_guard lock(mutex_);
  if (entries_.contains(sha256)) {
    fs::remove(path, error);
    return FindLocked(sha256);
  }
  PLANISH_RETURN_IF_ERROR(CheckRoom(size));
  fs::create_directories(fs::path(place).parent_path(), error);
  fs::rename(path, place, error);
  if (error) return Failed("create", place, error.value());
  entries_[sha256] = {size, blob, nullptr};
  bytes_ += size;
  return blob;
}

absl::StatusOr<BlobPtr> BlobStore::Find(const std::string& sha256) {
  const std::lock_guard lock(mutex_);
  return FindLocked(sha256);
}

absl::StatusOr<BlobPtr> BlobStore::FindLocked(const std::string& sha256) {
  const auto entry = entries_.find(sha256);
  if (entry == entries_.end()) {
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND",
                     absl::StrCat("the store has no bytes with SHA-256 ", absl::BytesToHexString(sha256)));
  }
  if (entry->second.kept != nullptr) return entry->second.kept;
  if (BlobPtr open = entry->second.open.lock()) return open;
  PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, MapFile(PathOf(sha256)));
  entry->second.open = blob;
  return blob;
}

bool BlobStore::Has(const std::string& sha256) const {
  const std::lock_guard lock(mutex_);
  return entries_.contains(sha256);
}

std::int64_t BlobStore::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

bool BlobStore::IsHeld(const Entry& entry) {
  return entry.kept != nullptr ? entry.kept.use_count() > 1 : !entry.open.expired();
}

BlobPtr BlobStore::Discard(const std::string& sha256, Entry* entry) {
  std::error_code ignored;  // a file that stays is found by the next Open() and collected then
  if (!directory_.empty()) fs::remove(PathOf(sha256), ignored);
  bytes_ -= entry->bytes;
  return std::move(entry->kept);
}

bool BlobStore::Remove(const std::string& sha256) {
  BlobPtr released;
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(sha256);
  if (entry == entries_.end()) return true;
  if (IsHeld(entry->second)) return false;
  released = Discard(sha256, &entry->second);
  entries_.erase(entry);
  return true;
}

void BlobStore::Collect(const std::function<bool(const std::string& sha256)>& is_used) {
  std::vector<BlobPtr> released;
  const std::lock_guard lock(mutex_);
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    if (IsHeld(entry->second) || is_used(entry->first)) {
      ++entry;
    } else {
      released.push_back(Discard(entry->first, &entry->second));
      entry = entries_.erase(entry);
    }
  }
}

std::string BlobStore::PathOf(const std::string& sha256) const {
  const std::string name = absl::BytesToHexString(sha256);
  return absl::StrCat(directory_, "/", name.substr(0, 2), "/", name);
}

absl::Status BlobStore::CheckRoom(std::int64_t bytes) const {
  if (bytes_ + bytes <= max_bytes_) return absl::OkStatus();
  return StorageFull(absl::StrCat("the server's store is full: it holds ", bytes_, " of ", max_bytes_, " bytes, and ",
                                  bytes, " more are needed"));
}

}  // namespace planish
