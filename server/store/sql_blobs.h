// Blobs as rows of PostgreSQL, so that a farm needs no other storage than its database.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/blob_store.h"
#include "server/store/sql.h"

namespace planish {

// A blob is a row of `stored_blobs` and chunks of up to 256 KiB in `blob_chunks`, written in one transaction. A number
// that is never used again connects them, so a reader never mixes chunks of two blobs. Ages are by the database's
// clock.
class SqlBlobStore : public BlobStore {
 public:
  // Sets up the tables. `database` is PostgreSQL (FAILED_PRECONDITION with STORE_UNFIT otherwise), and outlives the
  // store and the blobs that it opened. It may be the one of the JobStore or another one. Errors of SetUpTables().
  static absl::StatusOr<std::unique_ptr<SqlBlobStore>> Make(SqlDatabase* database);

  absl::StatusOr<bool> Renew(const BlobId& id) override;
  absl::StatusOr<bool> Has(const BlobId& id) override;
  absl::Status List(const std::function<void(const BlobEntry&)>& visit) override;
  absl::StatusOr<bool> Remove(const BlobId& id, absl::Duration min_age) override;
  bool is_shared() const override { return true; }

 protected:
  absl::StatusOr<Found> OpenUnverified(const BlobId& id) override;
  absl::StatusOr<std::string> PutNew(const BlobId& id, std::string_view bytes) override;
  absl::Status Drop(const BlobId& id, const std::string& version) override;

 private:
  explicit SqlBlobStore(SqlDatabase* database) : database_(database) {}

  SqlDatabase* const database_;
};

}  // namespace planish
