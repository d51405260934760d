#include "server/store/sql_uploads.h"

#include <algorithm>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/store/sql_schema.h"

namespace planish {
namespace {

constexpr char kParts[] = ".parts";

constexpr char kUploadColumns[] =
    "SELECT id, tenant, total_bytes, sha256, committed_bytes, complete, used, writer, last_writer FROM uploads";

constexpr std::string_view kUploadTables = R"sql(
  CREATE TABLE uploads (
    id TEXT COLLATE "C" PRIMARY KEY,
    tenant TEXT COLLATE "C" NOT NULL,
    total_bytes BIGINT NOT NULL,
    sha256 BYTEA NOT NULL,
    committed_bytes BIGINT NOT NULL,
    complete BIGINT NOT NULL,
    used BIGINT NOT NULL,
    writer BIGINT NOT NULL,
    last_writer BIGINT NOT NULL
  ) WITH (fillfactor = 50);
  CREATE INDEX uploads_by_blob ON uploads (sha256);
  CREATE TABLE upload_parts (
    upload TEXT COLLATE "C" NOT NULL,
    start BIGINT NOT NULL,
    bytes BIGINT NOT NULL,
    blob_sha256 BYTEA NOT NULL,
    PRIMARY KEY (upload, start)
  );
  CREATE INDEX upload_parts_by_blob ON upload_parts (blob_sha256);
)sql";

std::vector<UploadState> StatesOf(const SqlRows& rows) {
  std::vector<UploadState> states;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    UploadState state;
    state.id = rows.Bytes(i, 0);
    state.tenant = rows.Bytes(i, 1);
    state.total_bytes = rows.Int(i, 2);
    state.sha256 = rows.Bytes(i, 3);
    state.committed_bytes = rows.Int(i, 4);
    state.complete = rows.Int(i, 5) != 0;
    state.used = absl::FromUnixNanos(rows.Int(i, 6));
    state.writer = rows.Int(i, 7);
    state.last_writer = rows.Int(i, 8);
    states.push_back(std::move(state));
  }
  return states;
}

std::int64_t Nanoseconds(absl::Time time) {
  return absl::ToUnixNanos(time);
}

BlobId PartOf(const std::string& tenant, const UploadPiece& piece) {
  return {tenant + kParts, piece.blob_sha256};
}

// The line that precedes the bytes of a piece.
std::string HeaderOf(const UploadState& state, std::int64_t offset) {
  return absl::StrCat("planish upload ", state.id, " writer ", state.writer, " offset ", offset, "\n");
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqlUploads>> SqlUploads::Make(SqlDatabase* database, BlobStore* blobs,
                                                             SqlUploadsOptions options) {
  if (!database->has_clock()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_UNFIT",
                     "only PostgreSQL can keep uploads for several servers");
  }
  PLANISH_RETURN_IF_ERROR(SetUpTables(database, "uploads", {kUploadTables}));
  return std::unique_ptr<SqlUploads>(new SqlUploads(database, blobs, std::move(options)));
}

absl::Status SqlUploads::Open(const std::function<bool(const BlobId& id)>&) {
  return absl::OkStatus();  // keeps all uploads: other servers may use them, and Use() finds those without a blob
}

absl::StatusOr<absl::Time> SqlUploads::Now(SqlConnection& sql) const {
  if (options_.clock != nullptr) return options_.clock();
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql.Run("SELECT {now}", {}));
  return absl::FromUnixNanos(rows.Int(0, 0));
}

// ---- states

absl::StatusOr<UploadPlace::Added> SqlUploads::Add(UploadState fresh, const Admit& admit) {
  Added added;
  const absl::Status status = Transact(database_, Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
    // Uploads are added one at a time, so that two of them do not both take the last room.
    PLANISH_RETURN_IF_ERROR(sql.Serialize({"uploads"}));
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql.Run(kUploadColumns, {}));
    const std::vector<UploadState> others = StatesOf(rows);
    const auto known =
        std::find_if(others.begin(), others.end(), [&](const UploadState& each) { return each.id == fresh.id; });
    if (known != others.end()) {
      added = {*known, false};
      return absl::OkStatus();
    }
    PLANISH_RETURN_IF_ERROR(admit(others));
    PLANISH_ASSIGN_OR_RETURN(fresh.used, Now(sql));
    added = {fresh, true};
    return sql
        .Run(
            "INSERT INTO uploads (id, tenant, total_bytes, sha256, committed_bytes, complete, used, writer, "
            "last_writer) VALUES (?, ?, ?, ?, ?, ?, ?, 0, 0)",
            {std::string_view(fresh.id), std::string_view(fresh.tenant), fresh.total_bytes, SqlBytes{fresh.sha256},
             fresh.committed_bytes, std::int64_t{fresh.complete}, Nanoseconds(fresh.used)})
        .status();
  });
  PLANISH_RETURN_IF_ERROR(status);
  return added;
}

absl::StatusOr<std::optional<UploadState>> SqlUploads::Find(const std::string& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           sql->Run(absl::StrCat(kUploadColumns, " WHERE id = ?"), {std::string_view(id)}));
  if (rows.empty()) return std::nullopt;
  return StatesOf(rows).front();
}

absl::StatusOr<std::vector<UploadState>> SqlUploads::List() {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql->Run(kUploadColumns, {}));
  return StatesOf(rows);
}

absl::StatusOr<bool> SqlUploads::Uses(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           sql->Run("SELECT writer FROM uploads WHERE sha256 = ? AND tenant = ? LIMIT 1",
                                    {SqlBytes{id.sha256}, std::string_view(id.tenant)}));
  return !rows.empty();
}

absl::StatusOr<bool> SqlUploads::Change(const std::string& id, const ChangeState& change, const UploadPiece* piece) {
  bool is_there = false;
  UploadState state;
  std::vector<UploadPiece> dropped;
  const auto body = [&](SqlConnection& sql) -> absl::Status {
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                             sql.Run(absl::StrCat(kUploadColumns, " WHERE id = ? {lock}"), {std::string_view(id)}));
    is_there = !rows.empty();
    if (!is_there) return absl::OkStatus();
    state = StatesOf(rows).front();
    const std::int64_t before = state.committed_bytes;
    PLANISH_ASSIGN_OR_RETURN(const absl::Time now, Now(sql));
    PLANISH_RETURN_IF_ERROR(change(&state, now));
    if (state.complete || state.committed_bytes < before) {
      PLANISH_ASSIGN_OR_RETURN(dropped, PiecesOf(sql, id, state.complete ? 0 : state.committed_bytes, /*take=*/true));
    }
    if (piece != nullptr && state.complete) {
      dropped.push_back(*piece);
    } else if (piece != nullptr) {
      PLANISH_RETURN_IF_ERROR(sql.Run("INSERT INTO upload_parts VALUES (?, ?, ?, ?)",
                                      {std::string_view(id), piece->offset, piece->bytes, SqlBytes{piece->blob_sha256}})
                                  .status());
    }
    return sql
        .Run("UPDATE uploads SET committed_bytes = ?, complete = ?, used = ?, writer = ?, last_writer = ? WHERE id = ?",
             {state.committed_bytes, std::int64_t{state.complete}, Nanoseconds(state.used), state.writer,
              state.last_writer, std::string_view(id)})
        .status();
  };
  // If a loss of power undoes the change, the client sends the lost bytes again, unless they completed the upload.
  const bool may_complete = piece != nullptr;
  PLANISH_RETURN_IF_ERROR(Transact(database_, may_complete ? Durability::kNow : Durability::kLater, body));
  RemoveBlobs(state.tenant, dropped);
  return is_there;
}

absl::Status SqlUploads::Erase(const UploadState& state, bool if_unused) {
  std::vector<UploadPiece> pieces;
  const absl::Status status = Transact(database_, Durability::kNow, [&](SqlConnection& sql) -> absl::Status {
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                             sql.Run("DELETE FROM uploads WHERE id = ? AND (used = ? OR ? = 0) RETURNING writer",
                                     {std::string_view(state.id), Nanoseconds(state.used), std::int64_t{if_unused}}));
    if (rows.empty()) return absl::OkStatus();
    PLANISH_ASSIGN_OR_RETURN(pieces, PiecesOf(sql, state.id, 0, /*take=*/true));
    return absl::OkStatus();
  });
  PLANISH_RETURN_IF_ERROR(status);
  RemoveBlobs(state.tenant, pieces);
  return absl::OkStatus();
}

// ---- bytes

absl::StatusOr<std::vector<UploadPiece>> SqlUploads::PiecesOf(SqlConnection& sql, const std::string& id,
                                                              std::int64_t from, bool take) {
  const std::vector<SqlValue> which = {std::string_view(id), from};
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      sql.Run("SELECT start, bytes, blob_sha256 FROM upload_parts WHERE upload = ? AND start >= ? ORDER BY start",
              which));
  std::vector<UploadPiece> pieces;
  for (std::size_t i = 0; i < rows.size(); ++i) pieces.push_back({rows.Int(i, 0), rows.Int(i, 1), rows.Bytes(i, 2)});
  if (!take) return pieces;
  PLANISH_RETURN_IF_ERROR(sql.Run("DELETE FROM upload_parts WHERE upload = ? AND start >= ?", which).status());
  return pieces;
}

// Nothing refers to these blobs, and they are never put again. Those that cannot be removed now are collected later.
void SqlUploads::RemoveBlobs(const std::string& tenant, const std::vector<UploadPiece>& pieces) {
  for (const UploadPiece& piece : pieces) {
    blobs_->Remove(PartOf(tenant, piece), absl::ZeroDuration()).IgnoreError();
  }
}

absl::StatusOr<UploadPiece> SqlUploads::Write(const UploadState& state, std::string_view data) {
  std::string bytes = HeaderOf(state, state.committed_bytes);
  bytes += data;
  UploadPiece piece = {state.committed_bytes, static_cast<std::int64_t>(data.size()), Sha256(bytes)};
  PLANISH_RETURN_IF_ERROR(blobs_->Put(PartOf(state.tenant, piece), bytes));
  return piece;
}

absl::Status SqlUploads::Undo(const UploadState& state, const UploadPiece& piece) {
  RemoveBlobs(state.tenant, {piece});
  return absl::OkStatus();
}

absl::Status SqlUploads::Finish(const UploadState& state, const UploadPiece& piece, BlobCatalog* blobs) {
  std::vector<UploadPiece> pieces;
  {
    PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
    PLANISH_ASSIGN_OR_RETURN(pieces, PiecesOf(*sql, state.id, 0, /*take=*/false));
  }
  pieces.push_back(piece);
  const std::lock_guard lock(finishing_);
  PLANISH_ASSIGN_OR_RETURN(BlobWriter all, BlobWriter::Make(static_cast<std::size_t>(state.total_bytes)));
  std::int64_t end = 0;
  for (const UploadPiece& each : pieces) {
    absl::StatusOr<BlobPtr> part = blobs_->Load(PartOf(state.tenant, each));
    if (!part.ok() && !IsLost(part.status())) return part.status();
    if (!part.ok() || each.offset != end || each.bytes > state.total_bytes - end) {
      return UploadOffsetMismatch(state, end, absl::StrCat("the store lost what came after ", end, " bytes"));
    }
    const std::string_view bytes = (*part)->bytes();
    const std::size_t header = bytes.size() - static_cast<std::size_t>(each.bytes);
    std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(header), bytes.end(), all.data() + end);
    end += each.bytes;
  }
  if (end != state.total_bytes) {
    return UploadOffsetMismatch(state, end, absl::StrCat("the store lost what came after ", end, " bytes"));
  }
  const std::string_view bytes(all.data(), all.size());
  const std::string digest = Sha256(bytes);
  if (digest != state.sha256) return UploadDigestMismatch(state, digest);
  return blobs->PutDurably(state.Blob(), bytes);
}

// ---- collecting

bool SqlUploads::IsPart(const BlobId& id) {
  return id.tenant.ends_with(kParts);
}

absl::StatusOr<bool> SqlUploads::UsesPart(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease sql, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql->Run("SELECT start FROM upload_parts WHERE blob_sha256 = ? LIMIT 1",
                                                        {SqlBytes{id.sha256}}));
  return !rows.empty();
}

}  // namespace planish
