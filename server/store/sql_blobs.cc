#include "server/store/sql_blobs.h"

#include <algorithm>
#include <cstdint>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/sql_schema.h"

namespace planish {
namespace {

constexpr std::int64_t kChunkBytes = std::int64_t{256} << 10;
constexpr std::int64_t kPage = 1000;

// Chunks are not compressed, since Draco and UV hardly compress.
constexpr std::string_view kBlobTables = R"sql(
  CREATE SEQUENCE blob_numbers;
  CREATE TABLE stored_blobs (
    tenant TEXT COLLATE "C" NOT NULL,
    sha256 BYTEA NOT NULL,
    number BIGINT NOT NULL,
    bytes BIGINT NOT NULL,
    put_time BIGINT NOT NULL,
    PRIMARY KEY (tenant, sha256)
  ) WITH (fillfactor = 80);
  CREATE TABLE blob_chunks (
    blob BIGINT NOT NULL,
    chunk BIGINT NOT NULL,
    bytes BYTEA NOT NULL,
    PRIMARY KEY (blob, chunk)
  );
  ALTER TABLE blob_chunks ALTER COLUMN bytes SET STORAGE EXTERNAL;
)sql";

class ChunkedBlob : public StoredBlob {
 public:
  ChunkedBlob(SqlDatabase* database, std::int64_t number, std::int64_t size)
      : StoredBlob(size), database_(database), number_(number) {}

 protected:
  absl::Status ReadRange(std::int64_t offset, std::int64_t length, std::string* bytes) const override {
    PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
    const std::int64_t first = offset / kChunkBytes, last = (offset + length - 1) / kChunkBytes;
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows rows,
        sql->Run("SELECT chunk, bytes FROM blob_chunks WHERE blob = ? AND chunk BETWEEN ? AND ? ORDER BY chunk",
                 {number_, first, last}));
    bytes->reserve(static_cast<std::size_t>(length));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::int64_t begin = rows.Int(i, 0) * kChunkBytes;
      const std::string& chunk = rows.Bytes(i, 1);
      const auto size = static_cast<std::int64_t>(chunk.size());
      if (rows.Int(i, 0) != first + static_cast<std::int64_t>(i) ||
          size != std::min(kChunkBytes, this->size() - begin)) {
        break;
      }
      const std::int64_t from = std::max(offset, begin), until = std::min(offset + length, begin + size);
      bytes->append(chunk, static_cast<std::size_t>(from - begin), static_cast<std::size_t>(until - from));
    }
    if (static_cast<std::int64_t>(bytes->size()) == length) return absl::OkStatus();
    return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED", "the database lacks chunks of a blob");
  }

 private:
  SqlDatabase* const database_;
  const std::int64_t number_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqlBlobStore>> SqlBlobStore::Make(SqlDatabase* database) {
  if (!database->has_clock()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_UNFIT",
                     "only PostgreSQL can keep blobs for several servers");
  }
  PLANISH_RETURN_IF_ERROR(SetUpTables(database, "blobs", {kBlobTables}));
  return std::unique_ptr<SqlBlobStore>(new SqlBlobStore(database));
}

absl::StatusOr<BlobStore::Found> SqlBlobStore::OpenUnverified(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           sql->Run("SELECT number, bytes FROM stored_blobs WHERE tenant = ? AND sha256 = ?",
                                    {std::string_view(id.tenant), SqlBytes{id.sha256}}));
  if (rows.empty()) return BlobNotFound(id);
  const std::int64_t number = rows.Int(0, 0);
  return Found{std::make_shared<const ChunkedBlob>(database_, number, rows.Int(0, 1)), absl::StrCat(number)};
}

absl::StatusOr<std::string> SqlBlobStore::PutNew(const BlobId& id, std::string_view bytes) {
  std::string version;
  const absl::Status status = Transact(database_, Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
    version.clear();
    const std::string_view tenant = id.tenant;
    // Concurrent writers of the same blob wait here, so that only one of them sends the bytes.
    PLANISH_RETURN_IF_ERROR(sql.Serialize({absl::StrCat("blob/", id.tenant, "/", id.sha256)}));
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows there,
        sql.Run("UPDATE stored_blobs SET put_time = {now} WHERE tenant = ? AND sha256 = ? RETURNING number",
                {tenant, SqlBytes{id.sha256}}));
    if (!there.empty()) return absl::OkStatus();
    PLANISH_ASSIGN_OR_RETURN(const SqlRows next, sql.Run("SELECT nextval('blob_numbers')", {}));
    const std::int64_t number = next.Int(0, 0);
    const auto size = static_cast<std::int64_t>(bytes.size());
    for (std::int64_t offset = 0; offset < size; offset += kChunkBytes) {
      const std::string_view chunk = bytes.substr(static_cast<std::size_t>(offset), kChunkBytes);
      PLANISH_RETURN_IF_ERROR(
          sql.Run("INSERT INTO blob_chunks VALUES (?, ?, ?)", {number, offset / kChunkBytes, SqlBytes{chunk}})
              .status());
    }
    version = absl::StrCat(number);
    return sql
        .Run("INSERT INTO stored_blobs (tenant, sha256, number, bytes, put_time) VALUES (?, ?, ?, ?, {now})",
             {tenant, SqlBytes{id.sha256}, number, size})
        .status();
  });
  PLANISH_RETURN_IF_ERROR(status);
  return version;
}

absl::StatusOr<bool> SqlBlobStore::Has(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           sql->Run("SELECT number FROM stored_blobs WHERE tenant = ? AND sha256 = ?",
                                    {std::string_view(id.tenant), SqlBytes{id.sha256}}));
  return !rows.empty();
}

absl::StatusOr<bool> SqlBlobStore::Renew(const BlobId& id) {
  bool is_there = false;
  const absl::Status status = Transact(database_, Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows rows,
        sql.Run("UPDATE stored_blobs SET put_time = {now} WHERE tenant = ? AND sha256 = ? RETURNING number",
                {std::string_view(id.tenant), SqlBytes{id.sha256}}));
    is_there = !rows.empty();
    return absl::OkStatus();
  });
  PLANISH_RETURN_IF_ERROR(status);
  return is_there;
}

absl::Status SqlBlobStore::List(const std::function<void(const BlobEntry&)>& visit) {
  BlobId after;
  for (;;) {
    SqlRows rows;
    {
      PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
      PLANISH_ASSIGN_OR_RETURN(rows, sql->Run("SELECT tenant, sha256, bytes, {now} - put_time FROM stored_blobs "
                                              "WHERE (tenant, sha256) > (?, ?) ORDER BY tenant, sha256 LIMIT ?",
                                              {std::string_view(after.tenant), SqlBytes{after.sha256}, kPage}));
    }
    if (rows.empty()) return absl::OkStatus();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      after = {rows.Bytes(i, 0), rows.Bytes(i, 1)};
      visit({after, rows.Int(i, 2), absl::Nanoseconds(rows.Int(i, 3))});
    }
  }
}

absl::StatusOr<bool> SqlBlobStore::Remove(const BlobId& id, absl::Duration min_age) {
  bool is_gone = false;
  // If a concurrent Renew() has locked the row, this transaction waits for it, and then finds the blob too young.
  const absl::Status status = Transact(database_, Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
    const std::vector<SqlValue> key = {std::string_view(id.tenant), SqlBytes{id.sha256}};
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows removed,
        sql.Run("DELETE FROM stored_blobs WHERE tenant = ? AND sha256 = ? AND put_time <= {now} - ? RETURNING number",
                {key[0], key[1], absl::ToInt64Nanoseconds(min_age)}));
    for (std::size_t i = 0; i < removed.size(); ++i) {
      PLANISH_RETURN_IF_ERROR(sql.Run("DELETE FROM blob_chunks WHERE blob = ?", {removed.Int(i, 0)}).status());
    }
    PLANISH_ASSIGN_OR_RETURN(const SqlRows left,
                             sql.Run("SELECT number FROM stored_blobs WHERE tenant = ? AND sha256 = ?", key));
    is_gone = left.empty();
    return absl::OkStatus();
  });
  PLANISH_RETURN_IF_ERROR(status);
  return is_gone;
}

absl::Status SqlBlobStore::Drop(const BlobId& id, const std::string& version) {
  std::int64_t number = 0;
  if (!absl::SimpleAtoi(version, &number)) return InternalError("a version of a blob that is no number");
  return Transact(database_, Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
    PLANISH_RETURN_IF_ERROR(sql.Run("DELETE FROM stored_blobs WHERE tenant = ? AND sha256 = ? AND number = ?",
                                    {std::string_view(id.tenant), SqlBytes{id.sha256}, number})
                                .status());
    return sql.Run("DELETE FROM blob_chunks WHERE blob = ?", {number}).status();
  });
}

}  // namespace planish
