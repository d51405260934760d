#include "server/jobs/blob_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
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
#include "server/access/caller.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigestBytes = 32;
constexpr char kTemporary[] = "new-";
// The folder of a tenant's blobs; those of the default tenant, who was alone once, are beside.
constexpr char kTenantFolder[] = "tenant-";

// Of a blob's path below the store.
std::string TenantOf(const fs::path& path) {
  const std::string top = path.begin()->string();
  return top.starts_with(kTenantFolder) ? top.substr(sizeof(kTenantFolder) - 1) : kDefaultTenant;
}

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

BlobStore::BlobStore(std::string directory, std::int64_t max_bytes, TenantLimitsSource limits)
    : directory_(std::move(directory)), max_bytes_(max_bytes), limits_(std::move(limits)) {}

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
    const std::string tenant = TenantOf(entry->path().lexically_relative(directory_));
    entries_[{tenant, absl::HexStringToBytes(name)}].bytes = size;
    Count(tenant, size);
  }
  if (error) return Failed("read", directory_, error.value());
  for (const fs::path& path : torn) fs::remove(path, error);
  return absl::OkStatus();
}

absl::StatusOr<BlobPtr> BlobStore::Put(const std::string& tenant, std::string_view bytes, std::string sha256) {
  if (sha256.empty()) sha256 = Sha256(bytes);
  const BlobId id = {tenant, std::move(sha256)};
  const auto size = static_cast<std::int64_t>(bytes.size());
  std::string temporary;
  {
    const std::lock_guard lock(mutex_);
    if (entries_.contains(id)) return FindLocked(id);
    PLANISH_RETURN_IF_ERROR(CheckRoom(tenant, size));
    temporary = absl::StrCat(directory_, "/", kTemporary, next_temporary_++);
  }
  if (!directory_.empty()) {
    PLANISH_RETURN_IF_ERROR(WriteFile(temporary, bytes));
    absl::StatusOr<BlobPtr> blob = PutFile(id, temporary);
    std::error_code ignored;  // gone if all went well
    fs::remove(temporary, ignored);
    return blob;
  }
  PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, Blob::Copy(bytes));
  const std::lock_guard lock(mutex_);
  const auto [entry, is_new] = entries_.try_emplace(id);
  if (is_new) {
    entry->second = {size, {}, blob};
    Count(tenant, size);
  }
  return entry->second.kept;
}

absl::StatusOr<BlobPtr> BlobStore::PutFile(const BlobId& id, const std::string& path) {
  PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, MapFile(path));
  std::error_code error;
  if (directory_.empty()) {
    absl::StatusOr<BlobPtr> copy = Put(id.tenant, blob->bytes(), id.sha256);
    if (copy.ok()) fs::remove(path, error);
    return copy;
  }
  const std::string place = PathOf(id);
  const auto size = static_cast<std::int64_t>(blob->bytes().size());
  const std::lock_guard lock(mutex_);
  if (entries_.contains(id)) {
    fs::remove(path, error);
    return FindLocked(id);
  }
  PLANISH_RETURN_IF_ERROR(CheckRoom(id.tenant, size));
  fs::create_directories(fs::path(place).parent_path(), error);
  fs::rename(path, place, error);
  if (error) return Failed("create", place, error.value());
  entries_[id] = {size, blob, nullptr};
  Count(id.tenant, size);
  return blob;
}

absl::StatusOr<BlobPtr> BlobStore::Find(const BlobId& id) {
  const std::lock_guard lock(mutex_);
  return FindLocked(id);
}

absl::StatusOr<BlobPtr> BlobStore::FindLocked(const BlobId& id) {
  const auto entry = entries_.find(id);
  if (entry == entries_.end()) {
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND",
                     absl::StrCat("the store has no bytes with SHA-256 ", absl::BytesToHexString(id.sha256)));
  }
  if (entry->second.kept != nullptr) return entry->second.kept;
  if (BlobPtr open = entry->second.open.lock()) return open;
  PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, MapFile(PathOf(id)));
  entry->second.open = blob;
  return blob;
}

bool BlobStore::Has(const BlobId& id) const {
  const std::lock_guard lock(mutex_);
  return entries_.contains(id);
}

std::int64_t BlobStore::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

std::int64_t BlobStore::bytes(const std::string& tenant) const {
  const std::lock_guard lock(mutex_);
  return BytesOf(tenant);
}

std::string BlobStore::WhoGivesWay(const std::string& tenant, std::int64_t more) const {
  const std::lock_guard lock(mutex_);
  const std::int64_t own = BytesOf(tenant) + more;
  const std::int64_t limit = LimitOf(tenant);
  const auto tenants = static_cast<std::int64_t>(tenant_bytes_.size()) + (tenant_bytes_.contains(tenant) ? 0 : 1);
  if ((limit >= 0 && own > limit) || own > max_bytes_ / tenants) return tenant;
  const auto most = std::max_element(tenant_bytes_.begin(), tenant_bytes_.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == tenant_bytes_.end() ? tenant : most->first;
}

bool BlobStore::IsHeld(const Entry& entry) {
  return entry.kept != nullptr ? entry.kept.use_count() > 1 : !entry.open.expired();
}

BlobPtr BlobStore::Discard(const BlobId& id, Entry* entry) {
  std::error_code ignored;  // a file that stays is found by the next Open() and collected then
  if (!directory_.empty()) fs::remove(PathOf(id), ignored);
  Count(id.tenant, -entry->bytes);
  return std::move(entry->kept);
}

bool BlobStore::Remove(const BlobId& id) {
  BlobPtr released;
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  if (entry == entries_.end()) return true;
  if (IsHeld(entry->second)) return false;
  released = Discard(id, &entry->second);
  entries_.erase(entry);
  return true;
}

void BlobStore::Collect(const std::function<bool(const BlobId& id)>& is_used) {
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

std::string BlobStore::PathOf(const BlobId& id) const {
  const std::string name = absl::BytesToHexString(id.sha256);
  const std::string folder = id.tenant == kDefaultTenant ? "" : absl::StrCat("/", kTenantFolder, id.tenant);
  return absl::StrCat(directory_, folder, "/", name.substr(0, 2), "/", name);
}

std::int64_t BlobStore::BytesOf(const std::string& tenant) const {
  const auto found = tenant_bytes_.find(tenant);
  return found == tenant_bytes_.end() ? 0 : found->second;
}

std::int64_t BlobStore::LimitOf(const std::string& tenant) const {
  return limits_ == nullptr ? -1 : limits_(tenant).store_bytes;
}

// Whoever may have all of the store may know how full it is; what others have of it is theirs.
absl::Status BlobStore::CheckRoom(const std::string& tenant, std::int64_t bytes) const {
  const std::int64_t own = BytesOf(tenant);
  const std::int64_t limit = LimitOf(tenant);
  if (limit >= 0 && own + bytes > limit) {
    return StorageFull(absl::StrCat("the store of tenant ", tenant, " is full: it holds ", own, " of ", limit,
                                    " bytes, and ", bytes, " more are needed"));
  }
  if (bytes_ + bytes <= max_bytes_) return absl::OkStatus();
  return StorageFull(absl::StrCat("the server's store is full: it takes ", max_bytes_, " bytes, tenant ", tenant,
                                  " has ", own, " of them, and ", bytes, " more are needed"));
}

void BlobStore::Count(const std::string& tenant, std::int64_t bytes) {
  bytes_ += bytes;
  if ((tenant_bytes_[tenant] += bytes) == 0) tenant_bytes_.erase(tenant);
}

}  // namespace planish
