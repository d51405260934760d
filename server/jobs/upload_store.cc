#include "server/jobs/upload_store.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <set>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/access/fair_part.h"
#include "server/store/lifecycle.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

constexpr char kPart[] = ".part", kDone[] = ".done";

constexpr std::size_t kMaxUploadRequestId = 128;
// Of the SHA-256 that a request id becomes: too many to meet another one by accident.
constexpr std::size_t kRequestIdBytes = 16;

absl::Status UploadNotFound(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "UPLOAD_NOT_FOUND",
                   absl::StrCat("there is no upload '", name, "': it never was, or it expired or was deleted"),
                   {{"upload", name}});
}

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

// What may go well a moment later: no room, no descriptors, no memory.
bool MayPass(const absl::Status& status) {
  return absl::IsResourceExhausted(status);
}

std::string NameOf(const std::string& id) {
  return "uploads/" + id;
}

}  // namespace

// ---- writers

UploadWriter& UploadWriter::operator=(UploadWriter&& other) noexcept {
  if (this == &other) return *this;
  if (store_ != nullptr) store_->Release(*this);
  store_ = std::exchange(other.store_, nullptr);
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

UploadStore::UploadStore(UploadStoreOptions options, BlobCatalog* blobs) : options_(std::move(options)), blobs_(blobs) {}

absl::Status UploadStore::Open() {
  if (options_.directory.empty()) return absl::OkStatus();
  DIR* directory = opendir(options_.directory.c_str());
  if (directory == nullptr) {
    return InternalError(absl::StrCat("cannot read ", options_.directory, ": ", std::strerror(errno)));
  }
  std::vector<std::string> file_names;
  while (const dirent* file = readdir(directory)) file_names.emplace_back(file->d_name);
  closedir(directory);
  // Marks of complete uploads come first: what a crash left of the way there must go.
  std::stable_partition(file_names.begin(), file_names.end(),
                        [](const std::string& file_name) { return absl::EndsWith(file_name, kDone); });
  for (const std::string& file_name : file_names) {
    if (!absl::EndsWith(file_name, kPart) && !absl::EndsWith(file_name, kDone)) continue;
    PLANISH_RETURN_IF_ERROR(Recover(file_name));
  }
  return absl::OkStatus();
}

// ID-TOTAL-SHA256@TENANT.part or .done; before there were tenants, without "@TENANT". An id may have dashes. The id is
// empty if it is no such name.
UploadStore::Entry UploadStore::ParseFileName(const std::string& file_name) {
  Entry entry;
  std::string name = file_name.substr(0, file_name.rfind('.'));
  const std::size_t at = name.rfind('@');
  entry.tenant = at == std::string::npos ? kDefaultTenant : name.substr(at + 1);
  name.resize(std::min(at, name.size()));
  const std::size_t digest = name.rfind('-');
  if (digest == std::string::npos || digest == 0) return entry;
  const std::size_t total = name.rfind('-', digest - 1);
  if (total == std::string::npos || !absl::SimpleAtoi(name.substr(total + 1, digest - total - 1), &entry.total_bytes)) {
    return entry;
  }
  entry.sha256 = absl::HexStringToBytes(name.substr(digest + 1));
  entry.id = name.substr(0, total);
  return entry;
}

// The file's name says all that must be known beside its bytes, so the two can never disagree after a crash.
absl::Status UploadStore::Recover(const std::string& file_name) {
  const std::string path = absl::StrCat(options_.directory, "/", file_name);
  const bool complete = absl::EndsWith(file_name, kDone);
  Entry entry = ParseFileName(file_name);
  struct stat status = {};
  if (stat(path.c_str(), &status) != 0) entry.id.clear();
  entry.complete = complete;
  entry.used = options_.clock();
  entry.committed_bytes = complete ? entry.total_bytes : static_cast<std::int64_t>(status.st_size);
  const bool is_ours = !entry.id.empty() && !entry.tenant.empty() && entry.sha256.size() == kSha256Bytes;
  if (!is_ours || entries_.contains(NameOf(entry.id)) || entry.committed_bytes > entry.total_bytes ||
      (complete && !blobs_->Has(entry.Blob()))) {
    unlink(path.c_str());
    return absl::OkStatus();
  }
  if (!complete && entry.committed_bytes == entry.total_bytes) {
    // The process ended before it could make the upload complete. The client's next message will: it sends the last
    // byte.
    --entry.committed_bytes;
    if (truncate(path.c_str(), entry.committed_bytes) != 0) {
      return InternalError(absl::StrCat("cannot cut ", path, ": ", std::strerror(errno)));
    }
  }
  if (!complete) entry.file = std::make_shared<UploadFile>(path, entry.committed_bytes);
  entries_[NameOf(entry.id)] = std::move(entry);
  return absl::OkStatus();
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
  std::string name;
  {
    const std::lock_guard lock(mutex_);
    Entry entry;
    entry.tenant = caller.tenant;
    entry.total_bytes = total;
    entry.sha256 = request.sha256();
    entry.used = options_.clock();
    entry.id = NewId(caller, request.request_id());
    if (!request.request_id().empty()) {
      PLANISH_ASSIGN_OR_RETURN(const std::optional<v1::Upload> known, FindKnown(entry));
      if (known.has_value()) return *known;
    }
    while (entries_.contains(NameOf(entry.id))) entry.id = NewId(caller, "");
    name = NameOf(entry.id);
    // It counts as complete until we know better, so that a mesh that is here already never lacks room.
    entry.complete = true;
    entry.begins = true;
    entries_[name] = std::move(entry);
  }
  // The entry keeps a blob that is there from being collected, so this answer stays true.
  const BlobId id = {caller.tenant, request.sha256()};
  // A blob of an earlier process may be damaged: then it is asked for again.
  const bool is_here = blobs_->Has(id) && blobs_->Find(id).ok();
  if (is_here) {
    std::unique_lock lock(mutex_);
    PLANISH_ASSIGN_OR_RETURN(const Entry* known, Find(name));
    const Entry complete = *known;
    lock.unlock();
    const absl::Status marked = MarkComplete(complete);
    if (!marked.ok()) {
      lock.lock();
      Forget(name);
      return marked;
    }
  }

  const std::lock_guard lock(mutex_);
  PLANISH_ASSIGN_OR_RETURN(Entry * entry, Find(name));
  entry->begins = false;
  if (is_here) {
    ++complete_at_once_;
    Completed(entry);
    return ToProto(*entry);
  }
  entry->complete = false;
  absl::Status room = CheckRoom(*entry);
  if (room.ok() && !options_.directory.empty()) {
    // So that the upload outlives the process from the first moment on.
    const Descriptor file(open(PathOf(*entry, kPart).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
    if (file.get() < 0) room = WithRetryDelay(WriteError(errno, "cannot begin an upload"), options_.retry_delay);
  }
  if (!room.ok()) {
    entries_.erase(name);
    return room;
  }
  entry->file = std::make_shared<UploadFile>(options_.directory.empty() ? "" : PathOf(*entry, kPart));
  return ToProto(*entry);
}

// A request id makes the id, so that the two belong together for as long as the upload exists, restarts included.
std::string UploadStore::NewId(const Caller& caller, const std::string& request_id) const {
  std::string id = options_.new_id();
  if (request_id.empty()) return id;
  // What is before the dot names the server (IdsOf()).
  const std::size_t begin = id.rfind('.') == std::string::npos ? 0 : id.rfind('.') + 1;
  const std::string digest = Sha256(absl::StrCat(caller.tenant, "/", request_id)).substr(0, kRequestIdBytes);
  return id.substr(0, begin) + absl::BytesToHexString(digest);
}

absl::StatusOr<std::optional<v1::Upload>> UploadStore::FindKnown(const Entry& fresh) {
  const std::string name = NameOf(fresh.id);
  const auto found = entries_.find(name);
  if (found == entries_.end()) return std::nullopt;
  Entry& entry = found->second;
  if (entry.total_bytes != fresh.total_bytes || entry.sha256 != fresh.sha256) {
    return MakeError(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED",
                     absl::StrCat("the request_id belongs to ", name, ", which is of other bytes"), {{"upload", name}});
  }
  if (entry.begins) return Busy(name);
  entry.used = fresh.used;
  return ToProto(entry);
}

absl::Status UploadStore::CheckRoom(const Entry& newest) const {
  struct Taken {
    std::int64_t count = 0, bytes = 0;
  } all, own;
  std::set<std::string> tenants = {newest.tenant};
  for (const auto& [name, entry] : entries_) {
    if (entry.complete || &entry == &newest) continue;
    tenants.insert(entry.tenant);
    ++all.count;
    all.bytes += entry.total_bytes;
    if (entry.tenant != newest.tenant) continue;
    ++own.count;
    own.bytes += entry.total_bytes;
  }
  if (own.count == 0) return absl::OkStatus();
  const auto among = static_cast<std::int64_t>(tenants.size());
  if (!HasFairPart(own.count, all.count, 1, options_.max_uploads, among)) {
    return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL",
                                    absl::StrCat("too many uploads are under way already; ", own.count,
                                                 " are yours, and the server takes ", options_.max_uploads, " in all"),
                                    {{"upload_capacity", absl::StrCat(options_.max_uploads)}}),
                          options_.retry_delay);
  }
  if (!HasFairPart(own.bytes, all.bytes, newest.total_bytes, options_.max_bytes, among)) {
    return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL",
                                    absl::StrCat("the uploads under way need all of the ", options_.max_bytes,
                                                 " bytes there are for them"),
                                    {{"limit", absl::StrCat(options_.max_bytes)}}),
                          options_.retry_delay);
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::Upload> UploadStore::Get(const Caller& caller, const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const Entry* entry = Find(caller, name);
  if (entry == nullptr) return UploadNotFound(name);
  return ToProto(*entry);
}

absl::Status UploadStore::Delete(const Caller& caller, const std::string& name) {
  const std::lock_guard lock(mutex_);
  if (Find(caller, name) == nullptr) return UploadNotFound(name);
  Forget(name);
  return absl::OkStatus();
}

absl::StatusOr<UploadWriter> UploadStore::Write(const Caller& caller, const std::string& name) {
  const std::lock_guard lock(mutex_);
  if (Find(caller, name) == nullptr) return UploadNotFound(name);
  Entry* entry = &entries_.at(name);
  const absl::Time now = options_.clock();
  // A connection may be lost long before this side notices; its client must not wait for that.
  const bool gives_way = !entry->appending && now - entry->used >= options_.writer_limit;
  if (entry->writer != 0 && !gives_way) return Busy(name);
  entry->writer = ++last_writer_;
  entry->used = now;
  return UploadWriter(this, name, entry->writer);
}

absl::Status UploadStore::Append(const UploadWriter& writer, std::int64_t offset, std::string_view data) {
  Entry entry;  // as it was before
  {
    const std::lock_guard lock(mutex_);
    PLANISH_ASSIGN_OR_RETURN(Entry * current, Find(writer.name_));
    if (current->writer != writer.token_) return Busy(writer.name_);
    if (offset < 0) return FieldInvalid("offset", "offset is negative");
    const auto size = static_cast<std::int64_t>(data.size());
    const std::int64_t committed = current->committed_bytes;
    if (offset > committed || size > current->total_bytes - offset) {
      return MakeError(absl::StatusCode::kOutOfRange, "UPLOAD_OFFSET_MISMATCH",
                       absl::StrCat(size, " bytes at ", offset, " do not go on where ", committed, " of ",
                                    current->total_bytes, " bytes end"),
                       {{"upload", writer.name_}, {"committed_bytes", absl::StrCat(committed)}});
    }
    current->used = options_.clock();
    if (committed - offset >= size) return absl::OkStatus();  // nothing new
    data.remove_prefix(static_cast<std::size_t>(committed - offset));
    current->appending = true;
    entry = *current;
  }
  UploadFile* file = entry.file.get();
  absl::Status status = file->Append(data);
  const bool is_last = status.ok() && file->size() == entry.total_bytes;
  if (is_last) {
    do {
      status = TakeOver(entry, file);
    } while (IsStorageFull(status) && make_room_ != nullptr && make_room_(entry.tenant, entry.total_bytes));
    // The mesh is not ours to keep yet: the last piece must come again, when there may be room.
    if (MayPass(status)) {
      if (absl::Status undone = file->UndoAppend(); !undone.ok()) status = std::move(undone);
    }
  }

  // Before anybody hears that it is complete.
  const absl::Status marked = is_last && status.ok() ? MarkComplete(entry) : absl::OkStatus();

  const std::lock_guard lock(mutex_);
  const absl::StatusOr<Entry*> current = Find(writer.name_);
  if (!current.ok()) {
    if (!file->path().empty()) {
      unlink(file->path().c_str());
      unlink(PathOf(entry, kDone).c_str());
    }
    return current.status();
  }
  received_bytes_ += std::max<std::int64_t>(file->size() - entry.committed_bytes, 0);
  (*current)->appending = false;
  (*current)->used = options_.clock();
  (*current)->committed_bytes = file->size();
  if (MayPass(status)) return WithRetryDelay(std::move(status), options_.retry_delay);
  if (!status.ok()) {
    Forget(writer.name_);
    return status;
  }
  if (is_last) Completed(*current);
  return marked;
}

absl::Status UploadStore::TakeOver(const Entry& entry, UploadFile* file) {
  PLANISH_ASSIGN_OR_RETURN(const std::string digest, file->Digest());
  if (digest != entry.sha256) {
    return MakeError(absl::StatusCode::kInvalidArgument, "DIGEST_MISMATCH",
                     absl::StrCat("the bytes of ", NameOf(entry.id), " have the SHA-256 ",
                                  absl::BytesToHexString(digest), " instead of ", absl::BytesToHexString(entry.sha256)),
                     {{"upload", NameOf(entry.id)}, {"field", "data"}});
  }
  if (!file->path().empty()) return blobs_->PutFile(entry.Blob(), file->path());
  PLANISH_ASSIGN_OR_RETURN(const BlobPtr bytes, file->Map());
  return blobs_->Put(entry.tenant, bytes->bytes(), entry.sha256).status();
}

absl::Status UploadStore::MarkComplete(const Entry& entry) {
  if (options_.directory.empty()) return absl::OkStatus();
  Descriptor mark;
  FileLayer* const files = options_.files;
  const std::string path = PathOf(entry, kDone);
  absl::Status status;
  if (const int error = files->Open(path, O_WRONLY | O_CREAT, &mark); error != 0) {
    status = FileError("create", path, -error);
  } else {
    status = SyncFolder(files, options_.directory);
  }
  // The upload is complete all the same; without its mark it would be unknown after a restart.
  if (status.ok()) return status;
  return WithRetryDelay(std::move(status), options_.retry_delay);
}

void UploadStore::Release(const UploadWriter& writer) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(writer.name_);
  if (found == entries_.end() || found->second.writer != writer.token_) return;
  found->second.writer = 0;
  if (found->second.file != nullptr) found->second.file->Rest();
}

absl::StatusOr<UploadedMesh> UploadStore::Use(const Caller& caller, const std::string& name) {
  UploadedMesh mesh;
  {
    const std::lock_guard lock(mutex_);
    if (Find(caller, name) == nullptr) return UploadNotFound(name);
    Entry* entry = &entries_.at(name);
    if (!entry->complete) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "UPLOAD_INCOMPLETE",
                       absl::StrCat(name, " has ", entry->committed_bytes, " of ", entry->total_bytes, " bytes"),
                       {{"upload", name}, {"committed_bytes", absl::StrCat(entry->committed_bytes)}});
    }
    entry->used = options_.clock();
    mesh.sha256 = entry->sha256;
  }
  absl::StatusOr<BlobPtr> blob = blobs_->Load({caller.tenant, mesh.sha256});
  if (absl::IsNotFound(blob.status()) || absl::IsDataLoss(blob.status())) {
    // The store lost the bytes or found them damaged: whoever has them sends them again.
    const std::lock_guard lock(mutex_);
    if (Find(caller, name) != nullptr) Forget(name);
    return UploadNotFound(name);
  }
  if (MayPass(blob.status())) return WithRetryDelay(blob.status(), options_.retry_delay);
  PLANISH_RETURN_IF_ERROR(blob.status());
  mesh.mesh = *std::move(blob);
  return mesh;
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
  if (absl::IsNotFound(mesh.status()) || absl::IsDataLoss(mesh.status())) {
    return MakeError(absl::StatusCode::kNotFound, "MESH_NOT_FOUND",
                     absl::StrCat("the server does not have the mesh ", absl::BytesToHexString(sha256), ": send it"),
                     {{"mesh_sha256", absl::BytesToHexString(sha256)}});
  }
  if (MayPass(mesh.status())) return WithRetryDelay(mesh.status(), options_.retry_delay);
  PLANISH_RETURN_IF_ERROR(mesh.status());
  return UploadedMesh{*std::move(mesh), sha256};
}

void UploadStore::SetMaxBytes(std::int64_t max_bytes) {
  const std::lock_guard lock(mutex_);
  options_.max_bytes = max_bytes;
}

void UploadStore::Tick(absl::Time now) {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> idle;
  for (const auto& [name, entry] : entries_) {
    if (!entry.appending && now - entry.used >= options_.idle_limit) idle.push_back(name);
  }
  for (const std::string& name : idle) Forget(name);
}

bool UploadStore::Uses(const BlobId& id) const {
  const std::lock_guard lock(mutex_);
  return std::any_of(entries_.begin(), entries_.end(), [&](const auto& each) { return each.second.Blob() == id; });
}

UploadGauges UploadStore::Gauges() const {
  UploadGauges gauges;
  const std::lock_guard lock(mutex_);
  for (const auto& [name, entry] : entries_) {
    if (entry.complete) continue;
    ++gauges.open;
    gauges.announced_bytes += entry.total_bytes;
  }
  gauges.received_bytes = received_bytes_;
  gauges.complete_at_once = complete_at_once_;
  return gauges;
}

// ---- under the lock

absl::StatusOr<UploadStore::Entry*> UploadStore::Find(const std::string& name) {
  const auto found = entries_.find(name);
  if (found == entries_.end()) return UploadNotFound(name);
  return &found->second;
}

const UploadStore::Entry* UploadStore::Find(const Caller& caller, const std::string& name) const {
  const auto found = entries_.find(name);
  if (found == entries_.end() || found->second.tenant != caller.tenant || found->second.begins) return nullptr;
  return &found->second;
}

void UploadStore::Completed(Entry* entry) {
  entry->complete = true;
  entry->committed_bytes = entry->total_bytes;
  entry->file = nullptr;
  const std::string* oldest = nullptr;
  int count = 0;
  for (const auto& [name, each] : entries_) {
    if (!each.complete || each.tenant != entry->tenant) continue;
    ++count;
    if (&each != entry && (oldest == nullptr || each.used < entries_.at(*oldest).used)) oldest = &name;
  }
  if (count > options_.max_complete && oldest != nullptr) Forget(std::string(*oldest));
}

void UploadStore::Forget(const std::string& name) {
  const Entry& entry = entries_.at(name);
  if (!options_.directory.empty()) {
    unlink(PathOf(entry, kPart).c_str());
    unlink(PathOf(entry, kDone).c_str());
  }
  entries_.erase(name);
}

v1::Upload UploadStore::ToProto(const Entry& entry) const {
  v1::Upload upload;
  upload.set_name(NameOf(entry.id));
  upload.set_total_bytes(entry.total_bytes);
  upload.set_sha256(entry.sha256);
  upload.set_committed_bytes(entry.committed_bytes);
  *upload.mutable_expire_time() = ToTimestamp(entry.used + options_.idle_limit);
  return upload;
}

std::string UploadStore::PathOf(const Entry& entry, const char* suffix) const {
  return absl::StrCat(options_.directory, "/", entry.id, "-", entry.total_bytes, "-",
                      absl::BytesToHexString(entry.sha256), "@", entry.tenant, suffix);
}

}  // namespace planish
