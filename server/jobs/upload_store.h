// Uploads: meshes that arrive in pieces (planish.v1.CreateUpload).
//
//   Create ──> under way ── the last byte came, and the digest is right ──> complete ──> Use
//                 │  │                                                         │
//                 │  └─ the digest is wrong, Delete, or idle too long ─> gone <┘ Delete, or idle too long
//                 └─ one writer at a time; its bytes stay when it leaves
//
// Uploads are in an UploadPlace. The stores of several servers may share one: a writer that is cut off at one server
// continues at another. A writer has a fencing token; after another writer took over, its writes change nothing.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "planish/v1/planish.pb.h"
#include "server/access/caller.h"
#include "server/blobs/blob_catalog.h"
#include "server/store/ids.h"
#include "server/store/upload_place.h"

namespace planish {

struct UploadStoreOptions {
  // Holds the uploads; outlives the store. Null: they are in `directory`.
  UploadPlace* place = nullptr;
  // The directory of the uploads, which then outlive the process. It exists, belongs to this store alone, and is on the
  // file system of the blobs' directory. Empty: uploads are in memory.
  std::string directory;
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  // Uploads under way of all tenants, and the bytes that they announced. If other tenants use all of it, a tenant still
  // gets an equal part (HasFairPart). A tenant's only upload may have any size up to max_mesh_bytes.
  int max_uploads = 64;
  std::int64_t max_bytes = std::int64_t{4} << 30;
  int max_complete = 1024;                     // of each tenant; beyond it the least recently used one is forgotten
  absl::Duration idle_limit = absl::Hours(1);  // from the last use until an upload is forgotten
  // A writer that was silent for this long gives way to a new one. If servers share the place, time within an append
  // counts as silence, so an append that takes longer may lose the upload to another caller.
  absl::Duration writer_limit = absl::Seconds(5);
  // If there is no room, an upload under way that was not used for this long gives way to a new one of its tenant.
  absl::Duration gives_way_after = absl::Minutes(1);
  absl::Duration retry_delay = absl::Seconds(2);  // sent with QUEUE_FULL and STORAGE_FULL
  std::function<absl::Time()> clock = absl::Now;  // for uploads in `directory`
  std::function<std::string()> new_id = RandomId;
  FileLayer* files = FileLayer::System();  // for marks of complete uploads in `directory`
};

class UploadStore;

// The right to write to an upload. Movable, not thread-safe; must not outlive the store.
class UploadWriter {
 public:
  UploadWriter() = default;
  UploadWriter(UploadWriter&& other) noexcept { *this = std::move(other); }
  UploadWriter& operator=(UploadWriter&& other) noexcept;
  ~UploadWriter();

  const std::string& name() const { return name_; }

  // `data` begins at byte `offset` of the mesh. Adds those bytes of `data` that the upload does not have yet: all of
  // them or, after an error, none. May take long (files, digests). With its last byte the upload becomes complete.
  // OUT_OF_RANGE with UPLOAD_OFFSET_MISMATCH ("committed_bytes"), ABORTED with UPLOAD_BUSY if another writer took over,
  // NOT_FOUND with UPLOAD_NOT_FOUND if the upload was deleted, RESOURCE_EXHAUSTED with STORAGE_FULL and UNAVAILABLE
  // with STORE_UNAVAILABLE, both with a retry delay, INVALID_ARGUMENT with DIGEST_MISMATCH, after which the upload is
  // gone.
  absl::Status Append(std::int64_t offset, std::string_view data);

 private:
  friend class UploadStore;
  UploadWriter(UploadStore* store, std::string id, std::int64_t token)
      : store_(store), id_(std::move(id)), name_(UploadName(id_)), token_(token) {}

  UploadStore* store_ = nullptr;
  std::string id_, name_;
  std::int64_t token_ = 0;
};

struct UploadedMesh {
  BlobPtr mesh;
  std::string sha256;
};

// The result of UploadStore::Gauges().
struct UploadGauges {
  // Current, or as of the last answer of the place.
  int open = 0;                      // uploads under way
  std::int64_t announced_bytes = 0;  // bytes that these uploads announced
  // Counts of this store since it was made.
  std::int64_t received_bytes = 0;    // bytes that the uploads did not have yet
  std::int64_t complete_at_once = 0;  // uploads of meshes that the server already had
};

// Thread-safe. A shared place may be unreachable: UNAVAILABLE with STORE_UNAVAILABLE. Unknown names are NOT_FOUND with
// UPLOAD_NOT_FOUND; uploads of other tenants get exactly the same answer, also for callers with the right all-jobs.
class UploadStore {
 public:
  // Complete uploads become blobs in `blobs`, which must outlive the store and be opened before it.
  UploadStore(UploadStoreOptions options, BlobCatalog* blobs);

  // Called, without a lock held, when an upload is complete and the store is full. Returns whether it made room for
  // `bytes` of this tenant. Call SetMakeRoom() before any other function.
  using MakeRoom = std::function<bool(const std::string& tenant, std::int64_t bytes)>;
  void SetMakeRoom(MakeRoom make_room) { make_room_ = std::move(make_room); }
  // Called, without a lock held, to check that the disk has room for `bytes` that this tenant is about to send. Call
  // SetCheckDisk() before any other function.
  using CheckDisk = std::function<absl::Status(const std::string& tenant, std::int64_t bytes)>;
  void SetCheckDisk(CheckDisk check_disk) { check_disk_ = std::move(check_disk); }

  // Finds the uploads that an earlier process left. Call it before all other functions except the two above.
  absl::Status Open();

  // The tenant's upload with the same request id (ALREADY_EXISTS with REQUEST_ID_REUSED if that announced other bytes),
  // or a new one. INVALID_ARGUMENT with REQUEST_INVALID; RESOURCE_EXHAUSTED with MESH_TOO_LARGE, or with a retry delay
  // QUEUE_FULL (too many uploads) or STORAGE_FULL (too many bytes), unless uploads of the same tenant can give way
  // (UploadStoreOptions::gives_way_after). The upload is complete at once if `blobs` has these bytes of the same
  // tenant.
  absl::StatusOr<v1::Upload> Create(const Caller& caller, const v1::CreateUploadRequest& request);

  absl::StatusOr<v1::Upload> Get(const Caller& caller, const std::string& name);

  // The uploads under way of the caller's tenant, least recently used first.
  absl::StatusOr<v1::ListUploadsResponse> List(const Caller& caller) const;

  absl::Status Delete(const Caller& caller, const std::string& name);

  // The right to write to an upload. ABORTED with UPLOAD_BUSY while another writer has it. Writing to a complete upload
  // is allowed and has no effect: it skips the bytes that it has.
  absl::StatusOr<UploadWriter> Write(const Caller& caller, const std::string& name);

  // The bytes of a complete upload, which counts as used. FAILED_PRECONDITION with UPLOAD_INCOMPLETE
  // ("committed_bytes").
  absl::StatusOr<UploadedMesh> Use(const Caller& caller, const std::string& name);

  // Those digests of `sha256`, each once, for which `blobs` has no mesh of this tenant. INVALID_ARGUMENT with
  // REQUEST_INVALID.
  absl::StatusOr<std::vector<std::string>> FindMissing(const Caller& caller,
                                                       const std::vector<std::string>& sha256) const;

  // The mesh of this tenant in `blobs` with this digest. NOT_FOUND with MESH_NOT_FOUND, INVALID_ARGUMENT with
  // REQUEST_INVALID.
  absl::StatusOr<UploadedMesh> FindMesh(const Caller& caller, const std::string& sha256) const;

  // Changes UploadStoreOptions::max_bytes; uploads under way continue.
  void SetMaxBytes(std::int64_t max_bytes);

  // Forgets the uploads that have been idle too long at `now`. Any number of servers may call it.
  void Tick(absl::Time now);

  // Whether an upload refers to this blob or will become it. Also true if the place does not answer.
  bool Uses(const BlobId& id);

  UploadGauges Gauges();

 private:
  friend class UploadWriter;

  absl::Status Append(const UploadWriter& writer, std::int64_t offset, std::string_view data);
  void Release(const UploadWriter& writer);

  std::string NewId(const Caller& caller, const std::string& request_id) const;
  // The state of the upload `name`, which must be of the caller's tenant.
  absl::StatusOr<UploadState> Find(const Caller& caller, const std::string& name);
  absl::StatusOr<v1::Upload> Known(const UploadState& state, const v1::CreateUploadRequest& request);
  // OK if `newest` has room beside the other uploads under way; otherwise an error of Create().
  absl::Status CheckRoom(const UploadState& newest, const std::vector<UploadState>& others) const;
  // Forgets the tenant's least recently used upload under way, if it has been idle for long enough. Returns whether
  // there was one.
  absl::StatusOr<bool> Evict(const std::string& tenant);
  // OK if the disk has room for `fresh` and for the bytes that other uploads announced.
  absl::Status CheckDiskFor(const UploadState& fresh) const;
  // Writes `data` and, with the last byte, makes the upload's blob. Changes nothing if it fails.
  absl::StatusOr<UploadPiece> TakeIn(const UploadState& state, std::string_view data);
  // Forgets a complete upload if the tenant has too many of them beside `newest`.
  absl::Status ForgetOldest(const UploadState& newest);
  v1::Upload ToProto(const UploadState& state) const;
  absl::Status Later(absl::Status status) const;

  const UploadStoreOptions options_;
  std::atomic<std::int64_t> max_bytes_;
  const std::unique_ptr<UploadPlace> own_place_;
  UploadPlace* const place_;
  BlobCatalog* const blobs_;
  MakeRoom make_room_;    // null: no room can be made
  CheckDisk check_disk_;  // null: disk space is not limited

  std::mutex mutex_;
  UploadGauges gauges_;  // guarded by mutex_
};

}  // namespace planish
