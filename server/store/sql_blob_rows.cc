#include "server/store/sql_blob_rows.h"

#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/job_transaction.h"

namespace planish {

absl::StatusOr<SqlRows> SqlBlobRows::Ask(const std::string& sql, const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_.Connect(SqlDatabase::Use::kRead));
  return connection->Run(sql, values);
}

absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> SqlBlobRows::List() {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           Ask("SELECT tenant, sha256, CAST(length(bytes) AS BIGINT) FROM blobs", {}));
  std::vector<std::pair<BlobId, std::int64_t>> blobs;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    blobs.push_back({{rows.Bytes(i, 0), rows.Bytes(i, 1)}, rows.Int(i, 2)});
  }
  return blobs;
}

absl::StatusOr<std::string> SqlBlobRows::Read(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, Ask("SELECT bytes FROM blobs WHERE tenant = ? AND sha256 = ?",
                                                   {std::string_view(id.tenant), SqlBytes{id.sha256}}));
  if (!rows.empty()) return rows.Bytes(0, 0);
  return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "the job store does not have the bytes any more");
}

absl::StatusOr<bool> SqlBlobRows::Remove(const BlobId& id) {
  bool used = false;
  const absl::Status status = Transact(&database_, Durability::kLater, [&](SqlConnection& sql) -> absl::Status {
    const std::vector<SqlValue> key = {std::string_view(id.tenant), SqlBytes{id.sha256}};
    // A transaction that commits a record with this blob writes the blob's row as well, so the two wait for each other.
    PLANISH_RETURN_IF_ERROR(sql.Run("SELECT 1 FROM blobs WHERE tenant = ? AND sha256 = ? {lock}", key).status());
    PLANISH_ASSIGN_OR_RETURN(used, UsesBlobRow(&sql, id));
    return used ? absl::OkStatus() : sql.RunLater("DELETE FROM blobs WHERE tenant = ? AND sha256 = ?", key);
  });
  PLANISH_RETURN_IF_ERROR(status);
  return !used;
}

absl::StatusOr<bool> UsesBlobRow(SqlConnection* sql, const BlobId& id) {
  const std::string_view tenant = id.tenant;
  const SqlBytes sha256 = {id.sha256};
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      sql->Run(absl::StrCat("SELECT 1 FROM jobs WHERE ended = 0 AND mesh_sha256 = ? AND tenant = ? UNION ALL "
                            "SELECT 1 FROM jobs WHERE ended = 0 AND elements_sha256 = ? AND elements_sha256 != '' AND "
                            "tenant = ? UNION ALL "
                            "SELECT 1 FROM jobs WHERE ended = 1 AND {outcome} = ",
                            kSucceeded,
                            " AND uv_sha256 = ? AND uv_sha256 != '' "
                            "AND tenant = ? LIMIT 1"),
               {sha256, tenant, sha256, tenant, sha256, tenant}));
  return !rows.empty();
}

}  // namespace planish
