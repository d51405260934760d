// Meshes on their way here, piece by piece (planish.v1.CreateUpload).
//
//   Create ──> under way ── the last byte came, and the digest is right ──> complete ──> Use
//                 │  │                                                         │
//                 │  └─ the digest is wrong, Delete, or idle too long ─> gone <┘ Delete, or idle too long
//                 └─ a writer at a time; what it wrote stays when it goes
//
// Uploads are in an UploadPlace. Several stores, of several servers, may share one: a writer that is cut off at one
// goes on at another one. A writer has a fencing token; what it says after another one took over changes nothing.
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
  // Where uploads are; outlives the store. Null: in `directory`.
  UploadPlace* place = nullptr;
  // Exists and belongs to this store alone, on the file system of the blobs' directory: uploads outlive the process.
  // Empty: in memory.
  std::string directory;
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  // Uploads under way, and bytes they announced, of all tenants; where others have taken it all a tenant still gets an
  // equal part (HasFairPart). A tenant's only one may be of any size up to max_mesh_bytes.
  int max_uploads = 64;
  std::int64_t max_bytes = std::int64_t{4} << 30;
  int max_complete = 1024;                     // of a tenant; beyond these its one not used for longest is forgotten
  absl::Duration idle_limit = absl::Hours(1);  // from the last use until an upload is forgotten
  // A writer that is silent for so long gives way to a new one. Where servers share the place one may be cut off within
  // an append, which counts as silence there: an append that takes longer may lose the upload to another caller.
  absl::Duration writer_limit = absl::Seconds(5);
  // An upload under way that was not used for so long gives way to a new one of its tenant, where there is no room.
  absl::Duration gives_way_after = absl::Minutes(1);
  absl::Duration retry_delay = absl::Seconds(2);  // advice with QUEUE_FULL and STORAGE_FULL
  std::function<absl::Time()> clock = absl::Now;  // of `directory`
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

  // Takes in the part of `data`, which begins at byte `offset`, that the upload does not have yet: all of it or, after
  // an error, nothing. May take long (files, digests). With its last byte the upload becomes complete.
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

// What UploadStore::Gauges() says.
struct UploadGauges {
  // Now, or when the place last answered.
  int open = 0;                      // under way
  std::int64_t announced_bytes = 0;  // by these
  // At this store, since it was made.
  std::int64_t received_bytes = 0;    // that were not there yet
  std::int64_t complete_at_once = 0;  // uploads of bytes that the server had
};

// Thread-safe. A place that several servers share may be away: UNAVAILABLE with STORE_UNAVAILABLE. Unknown names are
// NOT_FOUND with UPLOAD_NOT_FOUND, and so are other tenants' uploads, word for word. (The right all-jobs changes
// nothing: there is nothing to see in an upload, and its bytes are its tenant's.)
class UploadStore {
 public:
  // `blobs`, which complete uploads go into, must outlive the store, and is open before Open().
  UploadStore(UploadStoreOptions options, BlobCatalog* blobs);

  // What to call, without a lock, where a complete upload finds the store full: whether it made room for so many bytes
  // of this tenant's. Before any other call.
  using MakeRoom = std::function<bool(const std::string& tenant, std::int64_t bytes)>;
  void SetMakeRoom(MakeRoom make_room) { make_room_ = std::move(make_room); }
  // Likewise: what to ask, without a lock, whether the disk has room for so many bytes of this tenant's that are to
  // come.
  using CheckDisk = std::function<absl::Status(const std::string& tenant, std::int64_t bytes)>;
  void SetCheckDisk(CheckDisk check_disk) { check_disk_ = std::move(check_disk); }

  // Finds the uploads that an earlier process left. Before any other call.
  absl::Status Open();

  // The upload of the same request id, if the tenant has one (ALREADY_EXISTS with REQUEST_ID_REUSED if that is of other
  // bytes), or a new one.
  // INVALID_ARGUMENT with REQUEST_INVALID; RESOURCE_EXHAUSTED with MESH_TOO_LARGE, or with a retry delay QUEUE_FULL
  // (too many uploads) or STORAGE_FULL (too many bytes), unless uploads of the same tenant can give way
  // (UploadStoreOptions::gives_way_after). Complete at once if `blobs` has these bytes of the
  // same tenant.
  absl::StatusOr<v1::Upload> Create(const Caller& caller, const v1::CreateUploadRequest& request);

  absl::StatusOr<v1::Upload> Get(const Caller& caller, const std::string& name);

  // Those of the caller's tenant that are under way, the one not used for longest first.
  absl::StatusOr<v1::ListUploadsResponse> List(const Caller& caller) const;

  absl::Status Delete(const Caller& caller, const std::string& name);

  // ABORTED with UPLOAD_BUSY while another writer is at it. A complete upload may be written to: it skips what it has.
  absl::StatusOr<UploadWriter> Write(const Caller& caller, const std::string& name);

  // The bytes of a complete upload, which counts as used. FAILED_PRECONDITION with UPLOAD_INCOMPLETE
  // ("committed_bytes").
  absl::StatusOr<UploadedMesh> Use(const Caller& caller, const std::string& name);

  // Those of `sha256` that `blobs` does not have, of this tenant, each once. INVALID_ARGUMENT with REQUEST_INVALID.
  absl::StatusOr<std::vector<std::string>> FindMissing(const Caller& caller,
                                                       const std::vector<std::string>& sha256) const;

  // A mesh that `blobs` has of this tenant. NOT_FOUND with MESH_NOT_FOUND, INVALID_ARGUMENT with REQUEST_INVALID.
  absl::StatusOr<UploadedMesh> FindMesh(const Caller& caller, const std::string& sha256) const;

  // UploadStoreOptions::max_bytes from now on; uploads under way go on.
  void SetMaxBytes(std::int64_t max_bytes);

  // Forgets the uploads that were idle too long at `now`. Any number of servers may do so.
  void Tick(absl::Time now);

  // Whether an upload stands for, or is to become, this blob. True too if the place does not answer.
  bool Uses(const BlobId& id);

  UploadGauges Gauges();

 private:
  friend class UploadWriter;

  absl::Status Append(const UploadWriter& writer, std::int64_t offset, std::string_view data);
  void Release(const UploadWriter& writer);

  std::string NewId(const Caller& caller, const std::string& request_id) const;
  // The state of an upload of the caller's tenant.
  absl::StatusOr<UploadState> Find(const Caller& caller, const std::string& name);
  absl::StatusOr<v1::Upload> Known(const UploadState& state, const v1::CreateUploadRequest& request);
  // For `newest`, an upload under way like others.
  absl::Status CheckRoom(const UploadState& newest, const std::vector<UploadState>& others) const;
  // Forgets the tenant's upload under way that was not used for longest, if that is long enough; whether there was one.
  absl::StatusOr<bool> Evict(const std::string& tenant);
  // Whether the disk has room for it and for what others have announced.
  absl::Status CheckDiskFor(const UploadState& fresh) const;
  // Writes and, with the last byte, makes the upload's blob; after an error everything is as it was.
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
  MakeRoom make_room_;    // null: there is none to be made
  CheckDisk check_disk_;  // null: there is always room

  std::mutex mutex_;
  UploadGauges gauges_;  // guarded by mutex_
};

}  // namespace planish
