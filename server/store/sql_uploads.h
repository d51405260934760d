// Uploads that several servers share: their states are rows of PostgreSQL, their bytes are blobs.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/blob_store.h"
#include "server/store/sql.h"
#include "server/store/upload_place.h"

namespace planish {

struct SqlUploadsOptions {
  // The clock of upload ages. Null: the database's own.
  std::function<absl::Time()> clock;
};

// Each piece that a writer sent is a blob of the pseudo-tenant "TENANT.parts": a line that identifies the piece, so
// that no two pieces are the same blob, and the bytes. The rows of an upload say which pieces count. A writer that was
// replaced may still write a blob, but no row; UsesPart() tells that such blobs are garbage.
//
// At the end one server assembles the pieces in memory, one upload at a time.
class SqlUploads : public UploadPlace {
 public:
  // Sets up the tables. `database` (PostgreSQL; FAILED_PRECONDITION with STORE_UNFIT otherwise) and `blobs`, which all
  // servers share, outlive the object. Errors of SetUpTables().
  static absl::StatusOr<std::unique_ptr<SqlUploads>> Make(SqlDatabase* database, BlobStore* blobs,
                                                          SqlUploadsOptions options = {});

  absl::Status Open(const std::function<bool(const BlobId& id)>& has_blob) override;
  bool knows_writers() const override { return false; }
  absl::StatusOr<Added> Add(UploadState fresh, const Admit& admit) override;
  absl::StatusOr<std::optional<UploadState>> Find(const std::string& id) override;
  absl::StatusOr<std::vector<UploadState>> List() override;
  absl::StatusOr<bool> Uses(const BlobId& id) override;
  absl::StatusOr<bool> Change(const std::string& id, const ChangeState& change, const UploadPiece* piece) override;
  absl::Status Erase(const UploadState& state, bool if_unused) override;
  absl::StatusOr<UploadPiece> Write(const UploadState& state, std::string_view data) override;
  absl::Status Undo(const UploadState& state, const UploadPiece& piece) override;
  absl::Status Finish(const UploadState& state, const UploadPiece& piece, BlobCatalog* blobs) override;

  // Whether a blob is a piece, and whether an upload uses it: for CollectBlobs() on the store of all blobs.
  static bool IsPart(const BlobId& id);
  absl::StatusOr<bool> UsesPart(const BlobId& id);

 private:
  SqlUploads(SqlDatabase* database, BlobStore* blobs, SqlUploadsOptions options)
      : database_(database), blobs_(blobs), options_(std::move(options)) {}

  absl::StatusOr<absl::Time> Now(SqlConnection& sql) const;
  // The pieces of an upload's rows, in order; deletes the rows if `take`.
  static absl::StatusOr<std::vector<UploadPiece>> PiecesOf(SqlConnection& sql, const std::string& id, std::int64_t from,
                                                           bool take);
  void RemoveBlobs(const std::string& tenant, const std::vector<UploadPiece>& pieces);

  SqlDatabase* const database_;
  BlobStore* const blobs_;
  const SqlUploadsOptions options_;
  std::mutex finishing_;  // held while all bytes of an upload are in memory
};

}  // namespace planish
