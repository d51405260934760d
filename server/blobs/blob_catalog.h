// What one server knows of its blobs: which there are, which are in use, and which small ones wait to be committed with
// a record.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/access/tenant.h"
#include "server/blobs/blob_rows.h"
#include "server/blobs/blob_store.h"
#include "server/blobs/stored_blob.h"
#include "server/blobs/tenant_room.h"
#include "server/link/blob.h"

namespace planish {

// Where blobs are.
struct BlobPlaces {
  std::shared_ptr<BlobStore> store = nullptr;  // null: in memory
  BlobRows* rows = nullptr;                    // outlives the catalog; null: small ones are in `store` like others
  // Of a shared store: the age that a blob must have before it goes. At least BlobStore::kReferenceTime.
  absl::Duration min_age = 2 * BlobStore::kReferenceTime;
};

// Equal bytes of one tenant are kept once; each tenant has its own, so that nobody can tell what others have from room,
// time or errors. Blobs stay until they are removed, and none goes while somebody holds it. Thread-safe.
//
// A blob in the store is durable when Put() or PutFile() returns. A small one is pending until the caller has committed
// it with its record (Pending(), Committed()). Blobs that are damaged or missing count as absent, as BlobStore says.
//
// If other processes share the store, a blob that the catalog does not know is looked for there, and removing one is
// left to Remove() of the store with BlobPlaces::min_age. Room is counted as of Open() or the last Refresh(),
// and of what this process has put, opened or removed since.
//
// Errors as of BlobStore, and RESOURCE_EXHAUSTED with STORAGE_FULL for the limits below.
class BlobCatalog {
 public:
  // At most `max_bytes` in all, and of each tenant as many as its TenantLimits::store_bytes say (null: no limits).
  BlobCatalog(BlobPlaces places, std::int64_t max_bytes, TenantLimitsSource limits = nullptr);

  // Called, without a lock, with each blob that was found damaged. Before any other call.
  void SetOnDamage(std::function<void(const absl::Status&)> on_damage) { on_damage_ = std::move(on_damage); }

  // Finds the blobs that an earlier process left.
  absl::Status Open();

  // Counts what other processes put into a shared store or removed from it since. May take long: it lists the store.
  absl::Status Refresh();

  // Keeps `bytes` for the tenant and returns the kept blob; computes the digest unless the caller knows it (`sha256`
  // not empty).
  absl::StatusOr<StoredBlobPtr> Put(const std::string& tenant, std::string_view bytes, std::string sha256 = {});

  // Takes over the complete file `path` (for a directory: on the same file system), whose digest the caller has
  // checked, and removes it from where it is. After an error it is where it was.
  absl::Status PutFile(const BlobId& id, const std::string& path);

  // Keeps `bytes`, durably, in the store even if they are few: for those who commit no record with them.
  absl::Status PutDurably(const BlobId& id, std::string_view bytes);

  // The blob, open for reading.
  absl::StatusOr<StoredBlobPtr> Find(const BlobId& id);

  // All its bytes in sealed memory, verified once more if they come from the store: for workers.
  absl::StatusOr<BlobPtr> Load(const BlobId& id);

  // Whether there is the blob and would be after a restart (in memory: whether there is). In a shared store the blob is
  // young from then on, as BlobStore::Renew() says. False too if a shared store does not answer: whoever has the bytes
  // may send them again.
  bool Has(const BlobId& id) const;

  // The blob if it waits to be committed with a record, otherwise null.
  StoredBlobPtr Pending(const BlobId& id) const;
  // The blob was committed.
  void Committed(const BlobId& id);

  // Whether blobs outlive the process, so that opening one may take long.
  bool is_durable() const { return places_.store != nullptr; }

  // Bytes of all blobs, and of a tenant's, those that are being put included.
  std::int64_t bytes() const;
  std::int64_t bytes(const std::string& tenant) const;
  std::int64_t max_bytes() const { return room_.max_bytes(); }

  // TenantRoom::WhoGivesWay().
  std::string WhoGivesWay(const std::string& tenant, std::int64_t more) const;

  // All blobs of this moment.
  std::vector<BlobId> Ids() const;

  // Whether there is nothing more to do: the blob is gone, or a shared store keeps it since it is too young. False if
  // somebody holds it. Calls BlobRows::Remove().
  bool Remove(const BlobId& id);

  // Removes every blob that `is_used` denies, unless it is held. Calls BlobRows::Remove().
  void Collect(const std::function<bool(const BlobId& id)>& is_used);

 private:
  enum class Place { kMemory, kPending, kRow, kStore };

  struct Entry {
    std::int64_t number = 0;  // tells it from another entry of the same id, before or after it
    std::int64_t bytes = 0;
    Place place = Place::kMemory;
    StoredBlobPtr kept;                    // kMemory, kPending
    std::weak_ptr<const StoredBlob> open;  // kRow, kStore: while somebody holds it
    int opening = 0;                       // callers that are about to hold it
    bool verified = false;                 // kRow: its bytes were those of its digest, in this process
  };

  // Room that a blob has before it is there.
  class Reservation;

  bool is_shared() const { return is_durable() && places_.store->is_shared(); }
  // Without mutex_. Reads what `entry`, a copy, stands for, and verifies it unless that was done.
  absl::StatusOr<StoredBlobPtr> OpenEntry(const BlobId& id, const Entry& entry);
  // Without mutex_. A blob that another process put; it has an entry from then on.
  absl::StatusOr<StoredBlobPtr> FindElsewhere(const BlobId& id);
  // Drops the entry if its bytes are lost; returns `status`.
  absl::Status Refuse(const BlobId& id, std::int64_t number, absl::Status status);
  // Without mutex_. Calls `put` to bring a blob into the store, and adds its entry.
  absl::Status Store(const BlobId& id, std::int64_t size, const std::function<absl::Status()>& put);

  // Both require mutex_.
  static bool IsHeld(const Entry& entry);
  Entry& Add(const BlobId& id, std::int64_t bytes, Place place);

  const BlobPlaces places_;
  std::function<void(const absl::Status&)> on_damage_;

  mutable std::mutex mutex_;
  std::condition_variable removed_;  // `removing_` became smaller
  // Guarded by mutex_.
  std::map<BlobId, Entry> entries_;
  std::set<BlobId> removing_;  // on their way out of the store: nobody puts them meanwhile
  TenantRoom room_;
  std::int64_t next_number_ = 1;
};

}  // namespace planish
