// Small blobs as rows of the database of the jobs that refer to them.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/blobs/blob_catalog.h"
#include "server/store/sql.h"

namespace planish {

// The rows of the table `blobs`. Thread-safe.
class SqlBlobRows : public BlobRows {
 public:
  // `database` outlives the object.
  explicit SqlBlobRows(SqlDatabase* database) : database_(*database) {}

  absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> List() override;
  absl::StatusOr<std::string> Read(const BlobId& id) override;
  absl::StatusOr<bool> Remove(const BlobId& id) override;

 private:
  absl::StatusOr<SqlRows> Ask(const std::string& sql, const std::vector<SqlValue>& values);

  SqlDatabase& database_;
};

// JobStore::UsesBlob.
absl::StatusOr<bool> UsesBlobRow(SqlConnection* sql, const BlobId& id);

}  // namespace planish
