// A server's catalog of its blobs: which exist, which are in use, and which small ones wait to be committed with a
// record.
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

// Where blobs are stored.
struct BlobPlaces {
  std::shared_ptr<BlobStore> store = nullptr;  // null: all blobs are in memory
  BlobRows* rows = nullptr;                    // outlives the catalog; null: small blobs are in `store` as well
  // For a shared store: the least age of a blob that may be removed. At least BlobStore::kReferenceTime.
  absl::Duration min_age = 2 * BlobStore::kReferenceTime;
};

// Equal bytes of one tenant are stored once. Tenants do not share bytes, so that nobody can learn what others have from
// room, time or errors. Blobs stay until they are removed, and none is removed while in use. Thread-safe.
//
// A blob in the store is durable when Put() or PutFile() returns. A small one is pending until the caller has committed
// it with its record (Pending(), Committed()). Damaged and missing blobs count as absent (see BlobStore).
//
// If other processes share the store, an unknown blob is looked up there, and removal goes through the store's Remove()
// with BlobPlaces::min_age. Room is counted as of Open() or the last Refresh(), plus what this process has put, opened
// or removed since.
//
// Errors as of BlobStore, and RESOURCE_EXHAUSTED with STORAGE_FULL for the limits below.
class BlobCatalog {
 public:
  // At most `max_bytes` in total, and TenantLimits::store_bytes for each tenant (null: no limits).
  BlobCatalog(BlobPlaces places, std::int64_t max_bytes, TenantLimitsSource limits = nullptr);

  // Is called, without a lock, for each damaged blob. Set it before any other call.
  void SetOnDamage(std::function<void(const absl::Status&)> on_damage) { on_damage_ = std::move(on_damage); }

  // Adds the blobs that earlier processes left to the catalog.
  absl::Status Open();

  // Counts what other processes have added to or removed from a shared store. May take long, as it lists the store.
  absl::Status Refresh();

  // Stores `bytes` for the tenant and returns the stored blob. Computes the digest unless the caller passes it
  // (`sha256` not empty).
  absl::StatusOr<StoredBlobPtr> Put(const std::string& tenant, std::string_view bytes, std::string sha256 = {});

  // Takes over the complete file `path`, whose digest the caller has checked. If the store is a directory, the file
  // must be on its file system. After an error the file is unchanged.
  absl::Status PutFile(const BlobId& id, const std::string& path);

  // Stores `bytes` durably, in the store even if they are small: for callers that commit no record with them.
  absl::Status PutDurably(const BlobId& id, std::string_view bytes);

  // The blob, open for reading.
  absl::StatusOr<StoredBlobPtr> Find(const BlobId& id);

  // All bytes of the blob in sealed memory, for workers. Bytes that come from the store are verified again.
  absl::StatusOr<BlobPtr> Load(const BlobId& id);

  // Whether the blob exists and would after a restart (in memory: whether it exists). In a shared store this renews the
  // blob (BlobStore::Renew()). Also false if a shared store does not answer: a caller that has the bytes may send them
  // again.
  bool Has(const BlobId& id) const;

  // The blob if it is pending, otherwise null.
  StoredBlobPtr Pending(const BlobId& id) const;
  // Call it when a pending blob was committed with its record.
  void Committed(const BlobId& id);

  // Whether blobs survive the process, so that opening one may take long.
  bool is_durable() const { return places_.store != nullptr; }

  // Bytes of all blobs, and of one tenant's, including those being put.
  std::int64_t bytes() const;
  std::int64_t bytes(const std::string& tenant) const;
  std::int64_t max_bytes() const { return room_.max_bytes(); }

  // See TenantRoom::WhoGivesWay().
  std::string WhoGivesWay(const std::string& tenant, std::int64_t more) const;

  // All current blobs.
  std::vector<BlobId> Ids() const;

  // Removes the blob unless it is in use. Returns false if it is in use, otherwise true: it is gone, or the store keeps
  // it for now (it is too young, a record needs it, or there was an error). Calls BlobRows::Remove().
  bool Remove(const BlobId& id);

  // Removes every blob for which `is_used` is false, unless it is in use. Calls BlobRows::Remove().
  void Collect(const std::function<bool(const BlobId& id)>& is_used);

 private:
  enum class Place { kMemory, kPending, kRow, kStore };

  struct Entry {
    std::int64_t number = 0;  // distinguishes it from earlier and later entries of the same id
    std::int64_t bytes = 0;
    Place place = Place::kMemory;
    StoredBlobPtr kept;                    // kMemory, kPending: the blob
    std::weak_ptr<const StoredBlob> open;  // kRow, kStore: the blob while somebody uses it
    int opening = 0;                       // callers that are opening it
    bool verified = false;                 // kRow: whether this process has verified its bytes
  };

  // Room reserved for a blob before it exists.
  class Reservation;

  bool is_shared() const { return is_durable() && places_.store->is_shared(); }
  // Call without mutex_. Opens the blob of `entry`, a copy of the catalog's entry, and verifies it unless that was
  // done.
  absl::StatusOr<StoredBlobPtr> OpenEntry(const BlobId& id, const Entry& entry);
  // Call without mutex_. Finds a blob that another process put, and adds an entry.
  absl::StatusOr<StoredBlobPtr> FindElsewhere(const BlobId& id);
  // Ends an attempt to open the blob of entry `number`, which failed with `status`. Drops the entry if the blob is
  // lost. Returns `status`.
  absl::Status Refuse(const BlobId& id, std::int64_t number, absl::Status status);
  // Call without mutex_. Calls `put` to bring a blob into the store, and adds its entry.
  absl::Status Store(const BlobId& id, std::int64_t size, const std::function<absl::Status()>& put);

  // IsHeld() (whether the blob is in use) and Add() require mutex_.
  static bool IsHeld(const Entry& entry);
  Entry& Add(const BlobId& id, std::int64_t bytes, Place place);

  const BlobPlaces places_;
  std::function<void(const absl::Status&)> on_damage_;

  mutable std::mutex mutex_;
  std::condition_variable removed_;  // `removing_` became smaller
  // Guarded by mutex_.
  std::map<BlobId, Entry> entries_;
  std::set<BlobId> removing_;  // being removed from the store: may not be put meanwhile
  TenantRoom room_;
  std::int64_t next_number_ = 1;
};

}  // namespace planish
