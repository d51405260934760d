#include "server/blobs/blob_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/access/caller.h"
#include "server/blobs/running_sha256.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

constexpr char kTemporary[] = "new-";
// The folder of a tenant's blobs; those of the default tenant, who was alone once, are beside.
constexpr char kTenantFolder[] = "tenant-";

constexpr std::int64_t kVerifyBytes = std::int64_t{1} << 20;

// Of a blob's path below the store.
std::string TenantOf(const fs::path& path) {
  const std::string top = path.begin()->string();
  return top.starts_with(kTenantFolder) ? top.substr(sizeof(kTenantFolder) - 1) : kDefaultTenant;
}

absl::Status StorageFull(const std::string& message) {
  return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", message);
}

absl::Status BlobNotFound(const BlobId& id) {
  return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND",
                   absl::StrCat("the store has no bytes with SHA-256 ", absl::BytesToHexString(id.sha256)));
}

absl::Status Damaged(const BlobId& id, const std::string& how) {
  return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED",
                   absl::StrCat("the store had damaged bytes in place of those with SHA-256 ",
                                absl::BytesToHexString(id.sha256), ": ", how));
}

// The blob is gone for good; any other error may pass.
bool IsLost(const absl::Status& status) {
  return absl::IsNotFound(status) || absl::IsDataLoss(status);
}

}  // namespace

BlobStore::BlobStore(BlobPlaces places, std::int64_t max_bytes, TenantLimitsSource limits)
    : places_(std::move(places)), max_bytes_(max_bytes), limits_(std::move(limits)) {}

absl::Status BlobStore::Open() {
  if (places_.directory.empty()) return absl::OkStatus();
  const std::lock_guard lock(mutex_);
  std::error_code error;
  std::vector<fs::path> torn;
  std::vector<std::string> folders = {places_.directory};
  for (fs::recursive_directory_iterator entry(places_.directory, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->is_directory(error)) folders.push_back(entry->path());
    if (!entry->is_regular_file(error)) continue;
    const std::string name = entry->path().filename();
    if (name.starts_with(kTemporary)) torn.push_back(entry->path());
    if (name.size() != 2 * kSha256Bytes) continue;
    const auto size = static_cast<std::int64_t>(entry->file_size(error));
    const std::string tenant = TenantOf(entry->path().lexically_relative(places_.directory));
    Add({tenant, absl::HexStringToBytes(name)}, size, Place::kFile);
  }
  if (error) return FileError("read", places_.directory, error.value());
  for (const fs::path& path : torn) fs::remove(path, error);
  // The process before may have died between the renaming of a file and the sync of its folder.
  for (const std::string& folder : folders) PLANISH_RETURN_IF_ERROR(SyncFolder(places_.files, folder));
  if (places_.rows == nullptr) return absl::OkStatus();
  PLANISH_ASSIGN_OR_RETURN(const auto rows, places_.rows->List());
  for (const auto& [id, size] : rows) {
    if (!entries_.contains(id)) Add(id, size, Place::kRow);
  }
  return absl::OkStatus();
}

// ---- writing

absl::Status BlobStore::WriteFile(const std::string& path, std::string_view bytes) {
  Descriptor file;
  int error = places_.files->Open(path, O_WRONLY | O_CREAT | O_EXCL, &file);
  if (error != 0) return FileError("create", path, -error);
  const char* what = "write";
  for (std::int64_t offset = 0; error == 0 && !bytes.empty();) {
    const ssize_t count = places_.files->Write(file.get(), bytes.data(), bytes.size(), offset);
    if (count < 0) {
      error = static_cast<int>(count);
    } else {
      bytes.remove_prefix(static_cast<std::size_t>(count));
      offset += count;
    }
  }
  if (error == 0) {
    what = "sync";
    error = places_.files->Sync(file.get());
  }
  if (error == 0) return absl::OkStatus();
  places_.files->Remove(path);  // a file that cannot be written whole does not stay
  return FileError(what, path, -error);
}

absl::StatusOr<StoredBlobPtr> BlobStore::Put(const std::string& tenant, std::string_view bytes, std::string sha256) {
  if (sha256.empty()) sha256 = Sha256(bytes);
  const BlobId id = {tenant, std::move(sha256)};
  const auto size = static_cast<std::int64_t>(bytes.size());
  for (;;) {
    std::string temporary;
    {
      const std::lock_guard lock(mutex_);
      if (!entries_.contains(id)) {
        PLANISH_RETURN_IF_ERROR(CheckRoom(tenant, size));
        temporary = absl::StrCat(places_.directory, "/", kTemporary, next_temporary_++);
      }
    }
    if (temporary.empty()) {
      absl::StatusOr<StoredBlobPtr> blob = Find(id);
      // What was damaged is gone now, so that these bytes can take its place.
      if (!blob.ok() && IsLost(blob.status())) continue;
      return blob;
    }
    const bool is_row = places_.rows != nullptr && size <= BlobRows::kMostBytes;
    if (!places_.directory.empty() && !is_row) {
      PLANISH_RETURN_IF_ERROR(WriteFile(temporary, bytes));
      if (absl::Status status = Install(id, temporary, size); !status.ok()) {
        places_.files->Remove(temporary);
        return status;
      }
      continue;  // to be found
    }
    PLANISH_ASSIGN_OR_RETURN(BlobPtr copy, Blob::Copy(bytes));
    StoredBlobPtr blob = StoredBlob::InMemory(std::move(copy));
    const std::lock_guard lock(mutex_);
    if (entries_.contains(id)) continue;  // somebody else put it meanwhile
    Add(id, size, is_row ? Place::kPending : Place::kMemory).kept = blob;
    return blob;
  }
}

absl::Status BlobStore::PutFile(const BlobId& id, const std::string& path) {
  Descriptor file;
  if (const int error = places_.files->Open(path, O_RDONLY, &file); error != 0) {
    return FileError("open", path, -error);
  }
  const off_t size = lseek(file.get(), 0, SEEK_END);
  if (size < 0) return FileError("measure", path, errno);
  if (places_.directory.empty()) {
    std::string bytes(static_cast<std::size_t>(size), '\0');
    PLANISH_RETURN_IF_ERROR(StoredBlob::ReadFile(places_.files, file.get(), 0, size, bytes.data()));
    PLANISH_RETURN_IF_ERROR(Put(id.tenant, bytes, id.sha256).status());
    places_.files->Remove(path);
    return absl::OkStatus();
  }
  if (const int error = places_.files->Sync(file.get()); error != 0) return FileError("sync", path, -error);
  return Install(id, path, size);
}

absl::Status BlobStore::Install(const BlobId& id, const std::string& path, std::int64_t size) {
  const std::string folder = FolderOf(id);
  if (id.tenant != kDefaultTenant) {
    PLANISH_RETURN_IF_ERROR(MakeDurableFolder(places_.files, folder.substr(0, folder.rfind('/'))));
  }
  PLANISH_RETURN_IF_ERROR(MakeDurableFolder(places_.files, folder));
  Descriptor opened;  // first of all, so that no want of descriptors comes in between
  if (const int error = places_.files->Open(folder, O_RDONLY | O_DIRECTORY, &opened); error != 0) {
    return FileError("open", folder, -error);
  }
  std::int64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto present = entries_.find(id);
    if (present == entries_.end()) PLANISH_RETURN_IF_ERROR(CheckRoom(id.tenant, size));
    if (const int error = places_.files->Rename(path, PathOf(id)); error != 0) {
      return FileError("create", PathOf(id), -error);
    }
    // The bytes are those of the digest, whatever was in their place. Who has the old ones open goes on with them.
    Entry& entry = present == entries_.end() ? Add(id, size, Place::kFile) : present->second;
    if (entry.place == Place::kFile) {
      Count(id.tenant, size - entry.bytes);
      entry.bytes = size;
      entry.verified = true;
      entry.durable = false;
      // It is another one now: who looks at the bytes of before must not refuse these.
      entry.number = next_number_++;
      entry.opening = 0;
    }
    ++entry.opening;
    number = entry.number;
  }
  const int error = places_.files->Sync(opened.get());
  StoredBlobPtr released;  // without the lock
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.number != number) {
    // Somebody else has put the same bytes since, and syncs the folder too.
    return error == 0 ? absl::OkStatus() : FileError("sync", folder, -error);
  }
  Entry& entry = found->second;
  --entry.opening;
  if (error != 0) {
    places_.files->Rename(PathOf(id), path);
    if (entry.place == Place::kFile) {
      Count(id.tenant, -entry.bytes);
      entries_.erase(found);
    }
    return FileError("sync", folder, -error);
  }
  // What was pending or a row is a file from now on; its row stays in the database until the blob is removed.
  if (entry.place != Place::kFile) {
    released = std::exchange(entry.kept, nullptr);
    if (released != nullptr) entry.open = released;
    entry.place = Place::kFile;
    entry.verified = true;
  }
  entry.durable = true;
  return absl::OkStatus();
}

StoredBlobPtr BlobStore::Pending(const BlobId& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  return entry != entries_.end() && entry->second.place == Place::kPending ? entry->second.kept : nullptr;
}

void BlobStore::Committed(const BlobId& id) {
  StoredBlobPtr released;  // without the lock
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  if (entry == entries_.end() || entry->second.place != Place::kPending) return;
  entry->second.place = Place::kRow;
  entry->second.verified = true;
  entry->second.open = released = std::exchange(entry->second.kept, nullptr);
}

// ---- reading

absl::StatusOr<StoredBlobPtr> BlobStore::Find(const BlobId& id) {
  Entry copy;
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return BlobNotFound(id);
    Entry& entry = found->second;
    if (entry.kept != nullptr) return entry.kept;
    if (StoredBlobPtr open = entry.open.lock(); open != nullptr && entry.durable) return open;
    ++entry.opening;
    copy = entry;
  }
  absl::StatusOr<StoredBlobPtr> blob = OpenEntry(id, copy);
  if (!blob.ok()) return Refuse(id, copy.number, blob.status());
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.number != copy.number) return BlobNotFound(id);
  Entry& entry = found->second;
  --entry.opening;
  entry.verified = entry.durable = true;
  if (StoredBlobPtr open = entry.open.lock()) return open;  // somebody else opened it meanwhile
  entry.open = *blob;
  return blob;
}

absl::StatusOr<StoredBlobPtr> BlobStore::OpenEntry(const BlobId& id, const Entry& entry) {
  if (entry.place == Place::kRow) {
    absl::StatusOr<std::string> bytes = places_.rows->Read(id);
    if (!bytes.ok()) return bytes.status();
    if (!entry.verified && Sha256(*bytes) != id.sha256) return Damaged(id, "they have another digest");
    PLANISH_ASSIGN_OR_RETURN(BlobPtr memory, Blob::Copy(*bytes));
    return StoredBlob::InMemory(std::move(memory));
  }
  const std::string path = PathOf(id);
  // Another thread put it, and is about to sync the folder.
  if (!entry.durable) PLANISH_RETURN_IF_ERROR(SyncFolder(places_.files, FolderOf(id)));
  Descriptor file;
  if (const int error = places_.files->Open(path, O_RDONLY, &file); error != 0) {
    return FileError("open", path, -error);
  }
  const off_t size = lseek(file.get(), 0, SEEK_END);
  if (size != entry.bytes) {
    return Damaged(id, absl::StrCat(path, " has ", size, " bytes and had ", entry.bytes));
  }
  if (!entry.verified) PLANISH_RETURN_IF_ERROR(Verify(id, file.get(), size));
  return StoredBlob::InFile(places_.files, std::move(file), size);
}

absl::Status BlobStore::Verify(const BlobId& id, int fd, std::int64_t size) {
  RunningSha256 hash;
  std::string buffer(static_cast<std::size_t>(std::min(size, kVerifyBytes)), '\0');
  for (std::int64_t offset = 0; offset < size;) {
    const std::int64_t length = std::min(size - offset, kVerifyBytes);
    PLANISH_RETURN_IF_ERROR(StoredBlob::ReadFile(places_.files, fd, offset, length, buffer.data()));
    hash.Update(std::string_view(buffer).substr(0, static_cast<std::size_t>(length)));
    offset += length;
  }
  return hash.Digest() == id.sha256 ? absl::OkStatus() : Damaged(id, PathOf(id) + " has another digest");
}

absl::StatusOr<BlobPtr> BlobStore::Load(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(StoredBlobPtr stored, Find(id));
  if (stored->memory() != nullptr) return BlobPtr(stored, stored->memory().get());
  PLANISH_ASSIGN_OR_RETURN(BlobWriter writer, BlobWriter::Make(static_cast<std::size_t>(stored->size())));
  std::int64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entries_.find(id);
    if (entry != entries_.end()) {
      number = entry->second.number;
      ++entry->second.opening;
    }
  }
  std::string buffer;
  RunningSha256 hash;
  absl::Status status;
  for (std::int64_t offset = 0; status.ok() && offset < stored->size();) {
    const std::int64_t length = std::min(stored->size() - offset, kVerifyBytes);
    status = stored->Read(offset, length, &buffer);
    if (!status.ok()) break;
    hash.Update(buffer);
    std::copy(buffer.begin(), buffer.end(), writer.data() + offset);
    offset += length;
  }
  if (status.ok() && hash.Digest() != id.sha256) status = Damaged(id, PathOf(id) + " has another digest");
  if (!status.ok()) return Refuse(id, number, std::move(status));
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entries_.find(id);
    if (entry != entries_.end() && entry->second.number == number) --entry->second.opening;
  }
  PLANISH_ASSIGN_OR_RETURN(BlobPtr memory, writer.Finish());
  // Whoever holds the copy holds the blob.
  const auto both = std::make_shared<std::pair<StoredBlobPtr, BlobPtr>>(std::move(stored), std::move(memory));
  return BlobPtr(both, both->second.get());
}

absl::Status BlobStore::Refuse(const BlobId& id, std::int64_t number, absl::Status status) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end() || found->second.number != number) return status;
    --found->second.opening;
    if (!IsLost(status)) return status;
    // A damaged row stays until the blob is put again, which replaces it, or until the next start.
    if (found->second.place == Place::kFile) places_.files->Remove(PathOf(id));
    Count(id.tenant, -found->second.bytes);
    entries_.erase(found);
  }
  if (on_damage_) on_damage_(status);
  return status;
}

bool BlobStore::Has(const BlobId& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  return entry != entries_.end() && entry->second.place != Place::kPending && entry->second.durable;
}

// ---- room

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

std::vector<BlobId> BlobStore::Ids() const {
  const std::lock_guard lock(mutex_);
  std::vector<BlobId> ids;
  ids.reserve(entries_.size());
  for (const auto& [id, entry] : entries_) ids.push_back(id);
  return ids;
}

bool BlobStore::IsHeld(const Entry& entry) {
  return entry.opening > 0 || (entry.kept != nullptr ? entry.kept.use_count() > 1 : !entry.open.expired());
}

void BlobStore::Discard(const BlobId& id, const Entry& entry) {
  // A file or a row that stays is found by the next Open() and collected then.
  if (entry.place == Place::kFile) places_.files->Remove(PathOf(id));
  if (entry.place != Place::kMemory && places_.rows != nullptr) places_.rows->Remove(id).IgnoreError();
  Count(id.tenant, -entry.bytes);
}

bool BlobStore::Remove(const BlobId& id) {
  Entry removed;  // its bytes are given back without the lock
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  if (entry == entries_.end()) return true;
  if (IsHeld(entry->second)) return false;
  Discard(id, entry->second);
  removed = std::move(entry->second);
  entries_.erase(entry);
  return true;
}

void BlobStore::Collect(const std::function<bool(const BlobId& id)>& is_used) {
  for (const BlobId& id : Ids()) {
    if (!is_used(id)) Remove(id);
  }
}

std::string BlobStore::FolderOf(const BlobId& id) const {
  const std::string folder = id.tenant == kDefaultTenant ? "" : absl::StrCat("/", kTenantFolder, id.tenant);
  return absl::StrCat(places_.directory, folder, "/", absl::BytesToHexString(id.sha256.substr(0, 1)));
}

std::string BlobStore::PathOf(const BlobId& id) const {
  return absl::StrCat(FolderOf(id), "/", absl::BytesToHexString(id.sha256));
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

BlobStore::Entry& BlobStore::Add(const BlobId& id, std::int64_t bytes, Place place) {
  Entry& entry = entries_[id];
  entry.number = next_number_++;
  entry.bytes = bytes;
  entry.place = place;
  Count(id.tenant, bytes);
  return entry;
}

void BlobStore::Count(const std::string& tenant, std::int64_t bytes) {
  bytes_ += bytes;
  if ((tenant_bytes_[tenant] += bytes) == 0) tenant_bytes_.erase(tenant);
}

}  // namespace planish
