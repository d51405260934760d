#include "server/blobs/blob_catalog.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/blobs/file_layer.h"

namespace planish {

class BlobCatalog::Reservation {
 public:
  Reservation(BlobCatalog* catalog, std::string tenant) : catalog_(*catalog), tenant_(std::move(tenant)) {}
  ~Reservation() {
    const std::lock_guard lock(catalog_.mutex_);
    GiveBack();
  }

  // Take() and GiveBack() require mutex_.
  absl::Status Take(std::int64_t bytes) {
    PLANISH_RETURN_IF_ERROR(catalog_.room_.Check(tenant_, bytes));
    catalog_.room_.Count(tenant_, bytes_ = bytes);
    return absl::OkStatus();
  }
  void GiveBack() { catalog_.room_.Count(tenant_, -std::exchange(bytes_, 0)); }

 private:
  BlobCatalog& catalog_;
  const std::string tenant_;
  std::int64_t bytes_ = 0;
};

BlobCatalog::BlobCatalog(BlobPlaces places, std::int64_t max_bytes, TenantLimitsSource limits)
    : places_(std::move(places)), room_(max_bytes, std::move(limits)) {}

absl::Status BlobCatalog::Open() {
  return Refresh();
}

absl::Status BlobCatalog::Refresh() {
  if (!is_durable()) return absl::OkStatus();
  std::int64_t begin = 0;
  {
    const std::lock_guard lock(mutex_);
    begin = next_number_;
  }
  std::map<BlobId, std::int64_t> stored, rows;
  PLANISH_RETURN_IF_ERROR(places_.store->List([&stored](const BlobEntry& entry) { stored[entry.id] = entry.bytes; }));
  if (places_.rows != nullptr) {
    PLANISH_ASSIGN_OR_RETURN(const auto list, places_.rows->List());
    rows.insert(list.begin(), list.end());
  }
  const std::lock_guard lock(mutex_);
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    const bool is_there = stored.contains(entry->first) || rows.contains(entry->first);
    if (is_there || entry->second.number >= begin || entry->second.kept != nullptr || IsHeld(entry->second)) {
      ++entry;
      continue;
    }
    room_.Count(entry->first.tenant, -entry->second.bytes);
    entry = entries_.erase(entry);
  }
  for (const auto& [place, found] : {std::pair(Place::kStore, &stored), std::pair(Place::kRow, &rows)}) {
    for (const auto& [id, size] : *found) {
      if (!entries_.contains(id) && !removing_.contains(id)) Add(id, size, place);
    }
  }
  return absl::OkStatus();
}

// ---- writing

absl::StatusOr<StoredBlobPtr> BlobCatalog::Put(const std::string& tenant, std::string_view bytes, std::string sha256) {
  if (sha256.empty()) sha256 = Sha256(bytes);
  const BlobId id = {tenant, std::move(sha256)};
  const auto size = static_cast<std::int64_t>(bytes.size());
  const bool is_row = places_.rows != nullptr && size <= BlobRows::kMostBytes;
  const bool is_stored = is_durable() && !is_row;
  for (;;) {
    bool is_new = false;
    {
      std::unique_lock lock(mutex_);
      removed_.wait(lock, [&] { return !removing_.contains(id); });
      const auto present = entries_.find(id);
      const bool is_present = present != entries_.end();
      // Another process may have removed the blob from a shared store, so it is put or committed again.
      is_new = !is_present || (is_shared() && present->second.kept == nullptr);
      if (is_new && !is_stored) {
        if (!is_present) PLANISH_RETURN_IF_ERROR(room_.Check(tenant, size));
        PLANISH_ASSIGN_OR_RETURN(BlobPtr copy, Blob::Copy(bytes));
        StoredBlobPtr blob = StoredBlob::InMemory(std::move(copy));
        Entry& entry = is_present ? present->second : Add(id, size, Place::kMemory);
        entry.place = is_durable() ? Place::kPending : Place::kMemory;
        entry.kept = blob;
        return blob;
      }
    }
    if (is_new) PLANISH_RETURN_IF_ERROR(Store(id, size, [&] { return places_.store->Put(id, bytes); }));
    absl::StatusOr<StoredBlobPtr> blob = Find(id);
    // A damaged blob is dropped now, so these bytes can replace it.
    if (!blob.ok() && IsLost(blob.status())) continue;
    return blob;
  }
}

absl::Status BlobCatalog::PutFile(const BlobId& id, const std::string& path) {
  Descriptor file;
  if (const int error = FileLayer::System()->Open(path, O_RDONLY, &file); error != 0) {
    return FileError("open", path, -error);
  }
  struct stat status = {};
  if (fstat(file.get(), &status) != 0) return FileError("measure", path, errno);
  if (is_durable()) return Store(id, status.st_size, [&] { return places_.store->PutFile(id, path); });
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  PLANISH_RETURN_IF_ERROR(StoredBlob::ReadFile(FileLayer::System(), file.get(), 0, status.st_size, bytes.data()));
  PLANISH_RETURN_IF_ERROR(Put(id.tenant, bytes, id.sha256).status());
  FileLayer::System()->Remove(path);
  return absl::OkStatus();
}

absl::Status BlobCatalog::PutDurably(const BlobId& id, std::string_view bytes) {
  if (!is_durable()) return Put(id.tenant, bytes, id.sha256).status();
  return Store(id, static_cast<std::int64_t>(bytes.size()), [&] { return places_.store->Put(id, bytes); });
}

absl::Status BlobCatalog::Store(const BlobId& id, std::int64_t size, const std::function<absl::Status()>& put) {
  Reservation room(this, id.tenant);
  std::int64_t number = 0;
  {
    std::unique_lock lock(mutex_);
    removed_.wait(lock, [&] { return !removing_.contains(id); });
    const auto present = entries_.find(id);
    if (present == entries_.end()) {
      PLANISH_RETURN_IF_ERROR(room.Take(size));
    } else {
      number = present->second.number;
      ++present->second.opening;
    }
  }
  const absl::Status status = put();
  StoredBlobPtr released;  // released without the lock
  const std::lock_guard lock(mutex_);
  room.GiveBack();
  auto entry = entries_.find(id);
  if (number != 0 && entry != entries_.end() && entry->second.number == number) --entry->second.opening;
  if (!status.ok()) return status;
  if (entry == entries_.end()) {
    Add(id, size, Place::kStore);
    return absl::OkStatus();
  }
  // A blob that was pending or a row is now in the store; its row stays in the database until the blob is removed.
  Entry& present = entry->second;
  room_.Count(id.tenant, size - present.bytes);
  present.bytes = size;
  released = std::exchange(present.kept, nullptr);
  if (released != nullptr) present.open = released;
  present.place = Place::kStore;
  return absl::OkStatus();
}

StoredBlobPtr BlobCatalog::Pending(const BlobId& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  return entry != entries_.end() && entry->second.place == Place::kPending ? entry->second.kept : nullptr;
}

void BlobCatalog::Committed(const BlobId& id) {
  StoredBlobPtr released;  // released without the lock
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  if (entry == entries_.end() || entry->second.place != Place::kPending) return;
  entry->second.place = Place::kRow;
  entry->second.verified = true;
  entry->second.open = released = std::exchange(entry->second.kept, nullptr);
}

// ---- reading

absl::StatusOr<StoredBlobPtr> BlobCatalog::Find(const BlobId& id) {
  Entry copy;
  bool is_known = false;
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = entries_.find(id); found != entries_.end()) {
      Entry& entry = found->second;
      if (entry.kept != nullptr) return entry.kept;
      if (StoredBlobPtr open = entry.open.lock()) return open;
      ++entry.opening;
      copy = entry;
      is_known = true;
    }
  }
  if (!is_known) return FindElsewhere(id);
  absl::StatusOr<StoredBlobPtr> blob = OpenEntry(id, copy);
  if (!blob.ok()) return Refuse(id, copy.number, blob.status());
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.number != copy.number) return BlobNotFound(id);
  Entry& entry = found->second;
  --entry.opening;
  entry.verified = true;
  if (StoredBlobPtr open = entry.open.lock()) return open;  // another thread opened it meanwhile
  entry.open = *blob;
  return blob;
}

absl::StatusOr<StoredBlobPtr> BlobCatalog::FindElsewhere(const BlobId& id) {
  if (!is_shared()) return BlobNotFound(id);
  absl::StatusOr<StoredBlobPtr> blob = places_.store->Open(id);
  Place place = Place::kStore;
  if (absl::IsNotFound(blob.status()) && places_.rows != nullptr) {
    place = Place::kRow;
    Entry row;
    row.place = place;
    blob = OpenEntry(id, row);
  }
  if (absl::IsDataLoss(blob.status()) && on_damage_) on_damage_(blob.status());
  PLANISH_RETURN_IF_ERROR(blob.status());
  const std::lock_guard lock(mutex_);
  if (!entries_.contains(id)) {
    Entry& entry = Add(id, (*blob)->size(), place);
    entry.verified = true;
    entry.open = *blob;
  }
  return blob;
}

absl::StatusOr<StoredBlobPtr> BlobCatalog::OpenEntry(const BlobId& id, const Entry& entry) {
  if (entry.place == Place::kStore) return places_.store->Open(id);
  PLANISH_ASSIGN_OR_RETURN(const std::string bytes, places_.rows->Read(id));
  if (!entry.verified && Sha256(bytes) != id.sha256) return BlobDamaged(id, "they have another digest");
  PLANISH_ASSIGN_OR_RETURN(BlobPtr memory, Blob::Copy(bytes));
  return StoredBlob::InMemory(std::move(memory));
}

absl::StatusOr<BlobPtr> BlobCatalog::Load(const BlobId& id) {
  StoredBlobPtr open;
  std::int64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(id);
    if (found != entries_.end() && found->second.place == Place::kStore) {
      number = found->second.number;
      open = found->second.open.lock();
      ++found->second.opening;
    }
  }
  if (number == 0) {
    PLANISH_ASSIGN_OR_RETURN(const StoredBlobPtr stored, Find(id));
    if (stored->memory() != nullptr) return BlobPtr(stored, stored->memory().get());
    return Load(id);  // Find() has added an entry
  }
  absl::StatusOr<BlobPtr> memory = places_.store->Load(id);
  if (!memory.ok()) return Refuse(id, number, memory.status());
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(id);
  if (found != entries_.end() && found->second.number == number) {
    --found->second.opening;
    if (open == nullptr) open = found->second.open.lock();
    if (open == nullptr) found->second.open = open = StoredBlob::InMemory(*memory);
  }
  // Whoever holds the returned copy also holds the stored blob.
  const auto both = std::make_shared<std::pair<StoredBlobPtr, BlobPtr>>(std::move(open), *std::move(memory));
  return BlobPtr(both, both->second.get());
}

absl::Status BlobCatalog::Refuse(const BlobId& id, std::int64_t number, absl::Status status) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end() || found->second.number != number) return status;
    --found->second.opening;
    if (!IsLost(status)) return status;
    // A damaged row stays until the blob is put again, which replaces it, or until the next start.
    room_.Count(id.tenant, -found->second.bytes);
    entries_.erase(found);
  }
  if (on_damage_) on_damage_(status);
  return status;
}

bool BlobCatalog::Has(const BlobId& id) const {
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entries_.find(id);
    const bool is_known = entry != entries_.end();
    if (is_known && entry->second.place == Place::kPending) return false;
    if (!is_shared() || (is_known && entry->second.place == Place::kRow)) return is_known;
  }
  return places_.store->Renew(id).value_or(false);
}

// ---- room

std::int64_t BlobCatalog::bytes() const {
  const std::lock_guard lock(mutex_);
  return room_.bytes();
}

std::int64_t BlobCatalog::bytes(const std::string& tenant) const {
  const std::lock_guard lock(mutex_);
  return room_.bytes(tenant);
}

std::string BlobCatalog::WhoGivesWay(const std::string& tenant, std::int64_t more) const {
  const std::lock_guard lock(mutex_);
  return room_.WhoGivesWay(tenant, more);
}

std::vector<BlobId> BlobCatalog::Ids() const {
  const std::lock_guard lock(mutex_);
  std::vector<BlobId> ids;
  ids.reserve(entries_.size());
  for (const auto& [id, entry] : entries_) ids.push_back(id);
  return ids;
}

bool BlobCatalog::IsHeld(const Entry& entry) {
  return entry.opening > 0 || (entry.kept != nullptr ? entry.kept.use_count() > 1 : !entry.open.expired());
}

bool BlobCatalog::Remove(const BlobId& id) {
  Entry removed;  // its bytes are freed without the lock
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entries_.find(id);
    if (entry == entries_.end()) return true;
    if (IsHeld(entry->second)) return false;
    room_.Count(id.tenant, -entry->second.bytes);
    removed = std::move(entry->second);
    entries_.erase(entry);
    removing_.insert(id);
  }
  // A blob that cannot be removed now is found by the next Open() and collected then.
  bool is_kept = false;
  Place kept_in = Place::kStore;
  if (removed.place == Place::kStore) {
    const absl::StatusOr<bool> gone = places_.store->Remove(id, is_shared() ? places_.min_age : absl::ZeroDuration());
    is_kept = is_shared() && !(gone.ok() && *gone);
  }
  if (removed.place != Place::kMemory && places_.rows != nullptr) {
    const absl::StatusOr<bool> gone = places_.rows->Remove(id);
    if (removed.place != Place::kStore && gone.ok() && !*gone) {
      is_kept = true;
      kept_in = Place::kRow;
    }
  }
  const std::lock_guard lock(mutex_);
  if (is_kept && !entries_.contains(id)) Add(id, removed.bytes, kept_in);
  removing_.erase(id);
  removed_.notify_all();
  return true;
}

void BlobCatalog::Collect(const std::function<bool(const BlobId& id)>& is_used) {
  for (const BlobId& id : Ids()) {
    if (!is_used(id)) Remove(id);
  }
}

BlobCatalog::Entry& BlobCatalog::Add(const BlobId& id, std::int64_t bytes, Place place) {
  Entry& entry = entries_[id];
  entry.number = next_number_++;
  entry.bytes = bytes;
  entry.place = place;
  room_.Count(id.tenant, bytes);
  return entry;
}

}  // namespace planish
