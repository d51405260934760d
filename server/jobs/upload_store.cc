#include "server/jobs/upload_store.h"

#include <algorithm>
#include <optional>
#include <set>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/access/fair_part.h"
#include "server/jobs/local_uploads.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

constexpr std::size_t kMaxUploadRequestId = 128;
// Bytes of the SHA-256 of a request id that are used: enough to exclude accidental collisions.
constexpr std::size_t kRequestIdBytes = 16;

constexpr std::string_view kUploads = "uploads/";

absl::Status Busy(const std::string& name) {
  return MakeError(absl::StatusCode::kAborted, "UPLOAD_BUSY", absl::StrCat("another call writes to ", name),
                   {{"upload", name}});
}

absl::Status FieldInvalid(const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", field}});
}

bool IsStorageFull(const absl::Status& status) {
  return ErrorInfoOf(status).reason == "STORAGE_FULL";
}

// Whether the error is transient: no room, no descriptors, no memory, or an unreachable store.
bool MayPass(const absl::Status& status) {
  return absl::IsResourceExhausted(status) || absl::IsUnavailable(status);
}

// The id in the name of an upload; empty for any other name.
std::string IdOf(const std::string& name) {
  return name.starts_with(kUploads) ? name.substr(kUploads.size()) : "";
}

std::unique_ptr<UploadPlace> PlaceOf(const UploadStoreOptions& options) {
  if (options.place != nullptr) return nullptr;
  return std::make_unique<LocalUploads>(LocalUploadsOptions{options.directory, options.clock, options.files});
}

}  // namespace

// ---- writers

UploadWriter& UploadWriter::operator=(UploadWriter&& other) noexcept {
  if (this == &other) return *this;
  if (store_ != nullptr) store_->Release(*this);
  store_ = std::exchange(other.store_, nullptr);
  id_ = std::move(other.id_);
  name_ = std::move(other.name_);
  token_ = other.token_;
  return *this;
}

UploadWriter::~UploadWriter() {
  if (store_ != nullptr) store_->Release(*this);
}

absl::Status UploadWriter::Append(std::int64_t offset, std::string_view data) {
  return store_->Append(*this, offset, data);
}

// ---- the store

UploadStore::UploadStore(UploadStoreOptions options, BlobCatalog* blobs)
    : options_(std::move(options)),
      max_bytes_(options_.max_bytes),
      own_place_(PlaceOf(options_)),
      place_(options_.place != nullptr ? options_.place : own_place_.get()),
      blobs_(blobs) {}

absl::Status UploadStore::Open() {
  return place_->Open([this](const BlobId& id) { return blobs_->Has(id); });
}

absl::StatusOr<v1::Upload> UploadStore::Create(const Caller& caller, const v1::CreateUploadRequest& request) {
  const std::int64_t total = request.total_bytes();
  if (total <= 0) return FieldInvalid("total_bytes", "total_bytes must be above 0");
  if (request.sha256().size() != kSha256Bytes) return FieldInvalid("sha256", "sha256 must have 32 bytes");
  if (total > options_.max_mesh_bytes) {
    return MakeError(
        absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
        absl::StrCat("the mesh has ", total, " bytes; this server takes at most ", options_.max_mesh_bytes),
        {{"bytes", absl::StrCat(total)}, {"limit", absl::StrCat(options_.max_mesh_bytes)}});
  }
  if (request.request_id().size() > kMaxUploadRequestId) {
    return FieldInvalid("request_id", absl::StrCat("request_id is longer than ", kMaxUploadRequestId, " bytes"));
  }
  UploadState fresh;
  fresh.id = NewId(caller, request.request_id());
  fresh.tenant = caller.tenant;
  fresh.total_bytes = total;
  fresh.sha256 = request.sha256();
  if (!request.request_id().empty()) {
    const absl::StatusOr<std::optional<UploadState>> known = place_->Find(fresh.id);
    if (!known.ok()) return Later(known.status());
    if (known->has_value()) return Known(**known, request);
  }
  // Holding the blob keeps it from being collected until the upload refers to it. A blob of an earlier process may be
  // damaged; then the bytes are asked for again.
  StoredBlobPtr held;
  if (blobs_->Has(fresh.Blob())) held = blobs_->Find(fresh.Blob()).value_or(nullptr);
  fresh.complete = held != nullptr;
  if (fresh.complete) fresh.committed_bytes = total;
  if (absl::Status disk = CheckDiskFor(fresh); !disk.ok()) return Later(std::move(disk));
  for (;;) {
    absl::Status room;
    const absl::StatusOr<UploadPlace::Added> added =
        place_->Add(fresh, [&](const std::vector<UploadState>& others) { return room = CheckRoom(fresh, others); });
    if (!added.ok() && !room.ok()) {
      PLANISH_ASSIGN_OR_RETURN(const bool evicted, Evict(fresh.tenant));
      if (evicted) continue;
    }
    if (!added.ok()) return Later(added.status());
    if (!added->created && !request.request_id().empty()) return Known(added->state, request);
    if (!added->created) {
      fresh.id = NewId(caller, "");
      continue;
    }
    if (fresh.complete) {
      {
        const std::lock_guard lock(mutex_);
        ++gauges_.complete_at_once;
      }
      PLANISH_RETURN_IF_ERROR(ForgetOldest(added->state));
    }
    return ToProto(added->state);
  }
}

// The id is derived from the request id, so the two belong together as long as the upload exists, across restarts too.
std::string UploadStore::NewId(const Caller& caller, const std::string& request_id) const {
  if (request_id.empty()) return options_.new_id();
  return absl::BytesToHexString(Sha256(absl::StrCat(caller.tenant, "/", request_id)).substr(0, kRequestIdBytes));
}

absl::StatusOr<v1::Upload> UploadStore::Known(const UploadState& state, const v1::CreateUploadRequest& request) {
  const std::string name = UploadName(state.id);
  if (state.total_bytes != request.total_bytes() || state.sha256 != request.sha256()) {
    return MakeError(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED",
                     absl::StrCat("the request_id belongs to ", name, ", which is of other bytes"), {{"upload", name}});
  }
  UploadState used;
  const absl::StatusOr<bool> is_there = place_->Change(state.id, [&](UploadState* changed, absl::Time now) {
    changed->used = now;
    used = *changed;
    return absl::OkStatus();
  });
  if (!is_there.ok()) return Later(is_there.status());
  // The upload was deleted just now: the caller's next attempt makes a new one.
  if (!*is_there) return Busy(name);
  return ToProto(used);
}

absl::Status UploadStore::CheckRoom(const UploadState& newest, const std::vector<UploadState>& others) const {
  if (newest.complete) return absl::OkStatus();
  struct Taken {
    std::int64_t count = 0, bytes = 0;
  } all, own;
  std::set<std::string> tenants = {newest.tenant};
  for (const UploadState& other : others) {
    if (other.complete) continue;
    tenants.insert(other.tenant);
    ++all.count;
    all.bytes += other.total_bytes;
    if (other.tenant != newest.tenant) continue;
    ++own.count;
    own.bytes += other.total_bytes;
  }
  if (own.count == 0) return absl::OkStatus();
  const auto among = static_cast<std::int64_t>(tenants.size());
  const std::int64_t max_bytes = max_bytes_;
  if (!HasFairPart(own.count, all.count, 1, options_.max_uploads, among)) {
    return MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL",
                     absl::StrCat("too many uploads are under way already; ", own.count,
                                  " are yours, and the server takes ", options_.max_uploads, " in all"),
                     {{"upload_capacity", absl::StrCat(options_.max_uploads)}});
  }
  if (!HasFairPart(own.bytes, all.bytes, newest.total_bytes, max_bytes, among)) {
    return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL",
                     absl::StrCat("the uploads under way need all of the ", max_bytes, " bytes there are for them"),
                     {{"limit", absl::StrCat(max_bytes)}});
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> UploadStore::Evict(const std::string& tenant) {
  const absl::StatusOr<std::vector<UploadState>> states = place_->List();
  if (!states.ok()) return Later(states.status());
  const UploadState* oldest = nullptr;
  for (const UploadState& each : *states) {
    if (each.complete || each.appending || each.tenant != tenant) continue;
    if (oldest == nullptr || each.used < oldest->used) oldest = &each;
  }
  if (oldest == nullptr) return false;
  absl::Duration idle;
  const absl::StatusOr<bool> is_there = place_->Change(oldest->id, [&](UploadState* state, absl::Time now) {
    idle = now - state->used;
    return absl::OkStatus();
  });
  if (!is_there.ok()) return Later(is_there.status());
  if (*is_there && idle < options_.gives_way_after) return false;
  PLANISH_RETURN_IF_ERROR(Later(place_->Erase(*oldest, /*if_unused=*/true)));
  return true;
}

absl::Status UploadStore::CheckDiskFor(const UploadState& fresh) const {
  if (check_disk_ == nullptr || fresh.complete) return absl::OkStatus();
  PLANISH_ASSIGN_OR_RETURN(const std::vector<UploadState> states, place_->List());
  std::int64_t bytes = fresh.total_bytes;
  for (const UploadState& each : states) bytes += each.total_bytes - each.committed_bytes;
  return check_disk_(fresh.tenant, bytes);
}

absl::StatusOr<UploadState> UploadStore::Find(const Caller& caller, const std::string& name) {
  absl::StatusOr<std::optional<UploadState>> found = place_->Find(IdOf(name));
  if (!found.ok()) return Later(found.status());
  if (!found->has_value() || (*found)->tenant != caller.tenant) return UploadNotFound(name);
  return **std::move(found);
}

absl::StatusOr<v1::Upload> UploadStore::Get(const Caller& caller, const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const UploadState state, Find(caller, name));
  return ToProto(state);
}

absl::StatusOr<v1::ListUploadsResponse> UploadStore::List(const Caller& caller) const {
  absl::StatusOr<std::vector<UploadState>> states = place_->List();
  if (!states.ok()) return Later(states.status());
  std::erase_if(*states, [&](const UploadState& each) { return each.complete || each.tenant != caller.tenant; });
  std::sort(states->begin(), states->end(), [](const UploadState& a, const UploadState& b) {
    return std::pair(a.used, a.id) < std::pair(b.used, b.id);
  });
  v1::ListUploadsResponse list;
  for (const UploadState& state : *states) *list.add_uploads() = ToProto(state);
  return list;
}

absl::Status UploadStore::Delete(const Caller& caller, const std::string& name) {
  PLANISH_ASSIGN_OR_RETURN(const UploadState state, Find(caller, name));
  return Later(place_->Erase(state, /*if_unused=*/false));
}

absl::StatusOr<UploadWriter> UploadStore::Write(const Caller& caller, const std::string& name) {
  std::int64_t token = 0;
  const absl::StatusOr<bool> is_there =
      place_->Change(IdOf(name), [&](UploadState* state, absl::Time now) -> absl::Status {
        if (state->tenant != caller.tenant) return UploadNotFound(name);
        // A lost connection may go unnoticed for long, and its client must not have to wait until it is noticed.
        const bool gives_way = !state->appending && now - state->used >= options_.writer_limit;
        if (state->writer != 0 && !gives_way) return Busy(name);
        token = state->writer = ++state->last_writer;
        state->used = now;
        return absl::OkStatus();
      });
  if (!is_there.ok()) return Later(is_there.status());
  if (!*is_there) return UploadNotFound(name);
  return UploadWriter(this, IdOf(name), token);
}

absl::Status UploadStore::Append(const UploadWriter& writer, std::int64_t offset, std::string_view data) {
  const auto size = static_cast<std::int64_t>(data.size());
  UploadState before;
  bool has_all = false;
  absl::StatusOr<bool> is_there = place_->Change(writer.id_, [&](UploadState* state, absl::Time now) -> absl::Status {
    if (state->writer != writer.token_) return Busy(writer.name_);
    if (offset < 0) return FieldInvalid("offset", "offset is negative");
    const std::int64_t committed = state->committed_bytes;
    if (offset > committed || size > state->total_bytes - offset) {
      return UploadOffsetMismatch(*state, committed,
                                  absl::StrCat(size, " bytes at ", offset, " do not go on where ", committed, " of ",
                                               state->total_bytes, " bytes end"));
    }
    state->used = now;
    has_all = committed - offset >= size;
    state->appending = !has_all && place_->knows_writers();
    before = *state;
    return absl::OkStatus();
  });
  if (!is_there.ok()) return Later(is_there.status());
  if (!*is_there) return UploadNotFound(writer.name_);
  if (has_all) return absl::OkStatus();
  data.remove_prefix(static_cast<std::size_t>(before.committed_bytes - offset));

  const absl::StatusOr<UploadPiece> piece = TakeIn(before, data);
  const absl::Status& status = piece.status();
  const bool is_lost = absl::IsOutOfRange(status);
  is_there = place_->Change(
      writer.id_,
      [&](UploadState* state, absl::Time now) -> absl::Status {
        if (state->writer != writer.token_) return Busy(writer.name_);
        state->appending = false;
        state->used = now;
        if (is_lost) state->committed_bytes = std::stoll(ErrorInfoOf(status).metadata.at("committed_bytes"));
        if (piece.ok()) state->committed_bytes += static_cast<std::int64_t>(data.size());
        state->complete = state->committed_bytes == state->total_bytes;
        return absl::OkStatus();
      },
      piece.ok() ? &*piece : nullptr);
  if (!is_there.ok()) {
    // Another writer took over, or the place is unreachable, so the piece does not count.
    const bool is_fenced = absl::IsAborted(is_there.status()) && !place_->knows_writers();
    if (piece.ok() && is_fenced) place_->Undo(before, *piece).IgnoreError();
    return Later(is_there.status());
  }
  if (!*is_there) {  // deleted meanwhile
    place_->Erase(before, /*if_unused=*/false).IgnoreError();
    return UploadNotFound(writer.name_);
  }
  if (MayPass(status)) return Later(status);
  if (!status.ok()) {
    // The upload is void if its bytes are wrong, or if an error left its file with unknown contents.
    const bool is_void = absl::IsInvalidArgument(status) || (place_->knows_writers() && !is_lost);
    if (is_void) PLANISH_RETURN_IF_ERROR(place_->Erase(before, /*if_unused=*/false));
    return status;
  }
  {
    const std::lock_guard lock(mutex_);
    gauges_.received_bytes += static_cast<std::int64_t>(data.size());
  }
  before.committed_bytes += static_cast<std::int64_t>(data.size());
  return before.committed_bytes == before.total_bytes ? ForgetOldest(before) : absl::OkStatus();
}

absl::StatusOr<UploadPiece> UploadStore::TakeIn(const UploadState& state, std::string_view data) {
  PLANISH_ASSIGN_OR_RETURN(UploadPiece piece, place_->Write(state, data));
  if (piece.offset + piece.bytes < state.total_bytes) return piece;
  absl::Status status;
  do {
    status = place_->Finish(state, piece, blobs_);
  } while (IsStorageFull(status) && make_room_ != nullptr && make_room_(state.tenant, state.total_bytes));
  if (status.ok()) return piece;
  // The mesh cannot be stored yet: the last piece must be sent again, when there may be room.
  PLANISH_RETURN_IF_ERROR(place_->Undo(state, piece));
  return status;
}

void UploadStore::Release(const UploadWriter& writer) {
  // If the place is unreachable now, the writer gives way later, when it has been silent for writer_limit.
  place_
      ->Change(writer.id_,
               [&](UploadState* state, absl::Time) {
                 if (state->writer == writer.token_) state->writer = 0;
                 return absl::OkStatus();
               })
      .status()
      .IgnoreError();
}

absl::StatusOr<UploadedMesh> UploadStore::Use(const Caller& caller, const std::string& name) {
  UploadState used;
  const absl::StatusOr<bool> is_there =
      place_->Change(IdOf(name), [&](UploadState* state, absl::Time now) -> absl::Status {
        if (state->tenant != caller.tenant) return UploadNotFound(name);
        if (!state->complete) {
          return MakeError(absl::StatusCode::kFailedPrecondition, "UPLOAD_INCOMPLETE",
                           absl::StrCat(name, " has ", state->committed_bytes, " of ", state->total_bytes, " bytes"),
                           {{"upload", name}, {"committed_bytes", absl::StrCat(state->committed_bytes)}});
        }
        state->used = now;
        used = *state;
        return absl::OkStatus();
      });
  if (!is_there.ok()) return Later(is_there.status());
  if (!*is_there) return UploadNotFound(name);
  absl::StatusOr<BlobPtr> blob = blobs_->Load(used.Blob());
  if (IsLost(blob.status())) {
    // The store lost the bytes or found them damaged: the caller sends them again.
    PLANISH_RETURN_IF_ERROR(Later(place_->Erase(used, /*if_unused=*/false)));
    return UploadNotFound(name);
  }
  if (!blob.ok()) return Later(blob.status());
  return UploadedMesh{*std::move(blob), used.sha256};
}

absl::StatusOr<std::vector<std::string>> UploadStore::FindMissing(const Caller& caller,
                                                                  const std::vector<std::string>& sha256) const {
  std::set<std::string> seen;
  std::vector<std::string> missing;
  for (const std::string& digest : sha256) {
    if (digest.size() != kSha256Bytes) return FieldInvalid("sha256", "a sha256 must have 32 bytes");
    const BlobId id = {caller.tenant, digest};
    if (seen.insert(digest).second && !(blobs_->Has(id) && blobs_->Find(id).ok())) missing.push_back(digest);
  }
  return missing;
}

absl::StatusOr<UploadedMesh> UploadStore::FindMesh(const Caller& caller, const std::string& sha256) const {
  if (sha256.size() != kSha256Bytes) return FieldInvalid("mesh_sha256", "mesh_sha256 must have 32 bytes");
  absl::StatusOr<BlobPtr> mesh = blobs_->Load({caller.tenant, sha256});
  if (IsLost(mesh.status())) {
    return MakeError(absl::StatusCode::kNotFound, "MESH_NOT_FOUND",
                     absl::StrCat("the server does not have the mesh ", absl::BytesToHexString(sha256), ": send it"),
                     {{"mesh_sha256", absl::BytesToHexString(sha256)}});
  }
  if (!mesh.ok()) return Later(mesh.status());
  return UploadedMesh{*std::move(mesh), sha256};
}

void UploadStore::SetMaxBytes(std::int64_t max_bytes) {
  max_bytes_ = max_bytes;
}

void UploadStore::Tick(absl::Time now) {
  const absl::StatusOr<std::vector<UploadState>> states = place_->List();
  if (!states.ok()) return;  // the next Tick() tries again
  for (const UploadState& state : *states) {
    if (state.appending || now - state.used < options_.idle_limit) continue;
    place_->Erase(state, /*if_unused=*/true).IgnoreError();
  }
}

bool UploadStore::Uses(const BlobId& id) {
  return place_->Uses(id).value_or(true);
}

UploadGauges UploadStore::Gauges() {
  const absl::StatusOr<std::vector<UploadState>> states = place_->List();
  const std::lock_guard lock(mutex_);
  if (!states.ok()) return gauges_;
  gauges_.open = 0;
  gauges_.announced_bytes = 0;
  for (const UploadState& state : *states) {
    if (state.complete) continue;
    ++gauges_.open;
    gauges_.announced_bytes += state.total_bytes;
  }
  return gauges_;
}

absl::Status UploadStore::ForgetOldest(const UploadState& newest) {
  const absl::StatusOr<std::vector<UploadState>> states = place_->List();
  if (!states.ok()) return Later(states.status());
  const UploadState* oldest = nullptr;
  int count = 0;
  for (const UploadState& each : *states) {
    if (!each.complete || each.tenant != newest.tenant) continue;
    ++count;
    if (each.id != newest.id && (oldest == nullptr || each.used < oldest->used)) oldest = &each;
  }
  if (count <= options_.max_complete || oldest == nullptr) return absl::OkStatus();
  return Later(place_->Erase(*oldest, /*if_unused=*/true));
}

v1::Upload UploadStore::ToProto(const UploadState& state) const {
  v1::Upload upload;
  upload.set_name(UploadName(state.id));
  upload.set_total_bytes(state.total_bytes);
  upload.set_sha256(state.sha256);
  upload.set_committed_bytes(state.committed_bytes);
  *upload.mutable_expire_time() = ToTimestamp(state.used + options_.idle_limit);
  return upload;
}

// Adds a retry delay if the error is transient.
absl::Status UploadStore::Later(absl::Status status) const {
  return MayPass(status) ? WithRetryDelay(std::move(status), options_.retry_delay) : status;
}

}  // namespace planish
