// Where uploads are until they are complete: what is known of each, and the bytes that have come.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/blob_catalog.h"

namespace planish {

struct UploadState {
  std::string id;
  std::string tenant;
  std::int64_t total_bytes = 0;
  std::string sha256;                // of all of them
  std::int64_t committed_bytes = 0;  // that have come
  bool complete = false;             // the bytes are a blob
  absl::Time used;
  std::int64_t writer = 0;       // fencing token of the writer at it, 0: none
  std::int64_t last_writer = 0;  // the token given last; the next one is greater
  bool appending = false;        // the writer is within an append; false where UploadPlace::knows_writers() is

  BlobId Blob() const { return {tenant, sha256}; }
};

// Bytes that were written and do not count yet.
struct UploadPiece {
  std::int64_t offset = 0;
  std::int64_t bytes = 0;
  std::string blob_sha256;  // of the blob that holds them, where they are one
};

// Uploads of one server, or of many that share the place. Thread-safe. Errors of all functions, beside those that they
// name: of BlobStore and of SqlConnection.
class UploadPlace {
 public:
  // What is to become of an upload at `now`, by the clock of the place. It stays as it was after an error. May be
  // called more than once; calls nothing of the place.
  using ChangeState = std::function<absl::Status(UploadState* state, absl::Time now)>;
  // Whether there is room for one more beside `others`.
  using Admit = std::function<absl::Status(const std::vector<UploadState>& others)>;

  virtual ~UploadPlace() = default;

  // Finds what an earlier process left. Before any other call. Complete uploads stay if `has_blob` is true of theirs.
  virtual absl::Status Open(const std::function<bool(const BlobId& id)>& has_blob) = 0;

  // Whether the place belongs to this process, so that UploadState::appending is true only while somebody appends.
  virtual bool knows_writers() const = 0;

  struct Added {
    UploadState state;
    bool created = false;  // false: there was one with this id already, `state`
  };
  // Adds an upload, used now, unless `admit` refuses; durable when the function returns.
  virtual absl::StatusOr<Added> Add(UploadState fresh, const Admit& admit) = 0;

  virtual absl::StatusOr<std::optional<UploadState>> Find(const std::string& id) = 0;
  virtual absl::StatusOr<std::vector<UploadState>> List() = 0;
  // Whether an upload stands for, or is to become, this blob.
  virtual absl::StatusOr<bool> Uses(const BlobId& id) = 0;

  // Changes the upload, and nobody else changes it meanwhile; whether there is one. `piece`, unless it is null, counts
  // from now on. What is complete is durable when the function returns. If committed_bytes become fewer, the bytes from
  // there on are gone.
  virtual absl::StatusOr<bool> Change(const std::string& id, const ChangeState& change,
                                      const UploadPiece* piece = nullptr) = 0;

  // Removes the upload and its bytes, but not its blob. `if_unused`: only if it was not used since `state` was read.
  virtual absl::Status Erase(const UploadState& state, bool if_unused) = 0;

  // ---- for the writer `state.writer`, one call at a time; `state` is what the last Change() made

  // Writes `data`, which goes on where state.committed_bytes end: all of it or, after an error, nothing.
  virtual absl::StatusOr<UploadPiece> Write(const UploadState& state, std::string_view data) = 0;
  // Takes back what was written last.
  virtual absl::Status Undo(const UploadState& state, const UploadPiece& piece) = 0;
  // With the last piece written: makes the bytes a blob, which outlives the process and a loss of power, and the upload
  // complete after a restart. INVALID_ARGUMENT with DIGEST_MISMATCH; OUT_OF_RANGE with UPLOAD_OFFSET_MISMATCH
  // ("committed_bytes") if bytes from there on were lost and have to come again.
  virtual absl::Status Finish(const UploadState& state, const UploadPiece& piece, BlobCatalog* blobs) = 0;
};

// As planish.v1 has it: "uploads/ID".
std::string UploadName(const std::string& id);

// Errors of several parts.
absl::Status UploadNotFound(const std::string& name);
absl::Status UploadDigestMismatch(const UploadState& state, const std::string& digest);
absl::Status UploadOffsetMismatch(const UploadState& state, std::int64_t committed_bytes, const std::string& message);

}  // namespace planish
