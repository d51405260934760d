// Where incomplete uploads are stored: the state of each, and its bytes so far.
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
  std::string sha256;                // of all bytes
  std::int64_t committed_bytes = 0;  // received so far
  bool complete = false;             // the bytes are a blob
  absl::Time used;
  std::int64_t writer = 0;       // fencing token of the current writer, 0: none
  std::int64_t last_writer = 0;  // the last token; the next one is greater
  bool appending = false;        // whether the writer is appending; always false unless UploadPlace::knows_writers()

  BlobId Blob() const { return {tenant, sha256}; }
};

// Bytes that were written but do not count yet.
struct UploadPiece {
  std::int64_t offset = 0;
  std::int64_t bytes = 0;
  std::string blob_sha256;  // of the blob that holds them, if they are a blob
};

// Uploads of one server, or of several that share the place. Thread-safe. Errors of all functions, beside those that
// they list: of BlobStore and of SqlConnection.
class UploadPlace {
 public:
  // Changes the state of an upload. `now` is by the clock of the place. After an error the upload is unchanged. May be
  // called more than once for one change; must not call the place.
  using ChangeState = std::function<absl::Status(UploadState* state, absl::Time now)>;
  // OK if there is room for another upload beside `others`; otherwise the error that Add() returns.
  using Admit = std::function<absl::Status(const std::vector<UploadState>& others)>;

  virtual ~UploadPlace() = default;

  // Finds the uploads that an earlier process left. Call it before all other functions. Complete uploads are kept if
  // `has_blob` is true for their blobs.
  virtual absl::Status Open(const std::function<bool(const BlobId& id)>& has_blob) = 0;

  // Whether only this process uses the place, so that UploadState::appending is reliable.
  virtual bool knows_writers() const = 0;

  struct Added {
    UploadState state;
    bool created = false;  // false: an upload with this id existed; it is `state`
  };
  // Adds an upload, last used now, unless `admit` refuses; durable when the function returns.
  virtual absl::StatusOr<Added> Add(UploadState fresh, const Admit& admit) = 0;

  virtual absl::StatusOr<std::optional<UploadState>> Find(const std::string& id) = 0;
  virtual absl::StatusOr<std::vector<UploadState>> List() = 0;
  // Whether an upload is, or will become, this blob.
  virtual absl::StatusOr<bool> Uses(const BlobId& id) = 0;

  // Changes the upload; no other change runs meanwhile. Returns whether the upload exists. `piece`, unless null, counts
  // from now on. If the upload becomes complete, that is durable when the function returns. If committed_bytes
  // decreases, the bytes from there on are dropped.
  virtual absl::StatusOr<bool> Change(const std::string& id, const ChangeState& change,
                                      const UploadPiece* piece = nullptr) = 0;

  // Removes the upload and its bytes, but not its blob. `if_unused`: only if it was not used since `state` was read.
  virtual absl::Status Erase(const UploadState& state, bool if_unused) = 0;

  // ---- for the writer `state.writer`, one call at a time; `state` is the result of the last Change()

  // Writes `data` at state.committed_bytes: all of it or, after an error, nothing.
  virtual absl::StatusOr<UploadPiece> Write(const UploadState& state, std::string_view data) = 0;
  // Undoes the last Write().
  virtual absl::Status Undo(const UploadState& state, const UploadPiece& piece) = 0;
  // Call it when the last piece was written: makes the bytes a blob that survives the process and a loss of power, and
  // the upload complete after a restart. INVALID_ARGUMENT with DIGEST_MISMATCH; OUT_OF_RANGE with
  // UPLOAD_OFFSET_MISMATCH if the bytes from "committed_bytes" on were lost and must be sent again.
  virtual absl::Status Finish(const UploadState& state, const UploadPiece& piece, BlobCatalog* blobs) = 0;
};

// The name in planish.v1: "uploads/ID".
std::string UploadName(const std::string& id);

// Errors that several parts return.
absl::Status UploadNotFound(const std::string& name);
absl::Status UploadDigestMismatch(const UploadState& state, const std::string& digest);
absl::Status UploadOffsetMismatch(const UploadState& state, std::int64_t committed_bytes, const std::string& message);

}  // namespace planish
