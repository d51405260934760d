#include "server/jobs/local_uploads.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/access/caller.h"

namespace planish {
namespace {

constexpr char kPart[] = ".part", kDone[] = ".done";

// Parses ID-TOTAL-SHA256@TENANT.part or .done; files from before there were tenants lack "@TENANT". An id may contain
// dashes. The id in the result is empty if the name has another form.
UploadState ParseFileName(const std::string& file_name) {
  UploadState state;
  std::string name = file_name.substr(0, file_name.rfind('.'));
  const std::size_t at = name.rfind('@');
  state.tenant = at == std::string::npos ? kDefaultTenant : name.substr(at + 1);
  name.resize(std::min(at, name.size()));
  const std::size_t digest = name.rfind('-');
  if (digest == std::string::npos || digest == 0) return state;
  const std::size_t total = name.rfind('-', digest - 1);
  if (total == std::string::npos || !absl::SimpleAtoi(name.substr(total + 1, digest - total - 1), &state.total_bytes)) {
    return state;
  }
  state.sha256 = absl::HexStringToBytes(name.substr(digest + 1));
  state.id = name.substr(0, total);
  return state;
}

}  // namespace

absl::Status LocalUploads::Open(const std::function<bool(const BlobId& id)>& has_blob) {
  if (options_.directory.empty()) return absl::OkStatus();
  DIR* directory = opendir(options_.directory.c_str());
  if (directory == nullptr) {
    return InternalError(absl::StrCat("cannot read ", options_.directory, ": ", std::strerror(errno)));
  }
  std::vector<std::string> file_names;
  while (const dirent* file = readdir(directory)) file_names.emplace_back(file->d_name);
  closedir(directory);
  // Marks of complete uploads come first, so that a .part file that a crash left beside its mark is removed.
  std::stable_partition(file_names.begin(), file_names.end(),
                        [](const std::string& file_name) { return absl::EndsWith(file_name, kDone); });
  for (const std::string& file_name : file_names) {
    if (!absl::EndsWith(file_name, kPart) && !absl::EndsWith(file_name, kDone)) continue;
    PLANISH_RETURN_IF_ERROR(Recover(file_name, has_blob));
  }
  return absl::OkStatus();
}

absl::Status LocalUploads::Recover(const std::string& file_name,
                                   const std::function<bool(const BlobId& id)>& has_blob) {
  const std::string path = absl::StrCat(options_.directory, "/", file_name);
  UploadState state = ParseFileName(file_name);
  struct stat status = {};
  if (stat(path.c_str(), &status) != 0) state.id.clear();
  state.complete = absl::EndsWith(file_name, kDone);
  state.used = options_.clock();
  state.committed_bytes = state.complete ? state.total_bytes : static_cast<std::int64_t>(status.st_size);
  const bool is_ours = !state.id.empty() && !state.tenant.empty() && state.sha256.size() == kSha256Bytes;
  if (!is_ours || entries_.contains(state.id) || state.committed_bytes > state.total_bytes ||
      (state.complete && !has_blob(state.Blob()))) {
    unlink(path.c_str());
    return absl::OkStatus();
  }
  if (!state.complete && state.committed_bytes == state.total_bytes) {
    // The process ended before it could make the upload complete. Drops the last byte, so that the client sends it
    // again, which completes the upload.
    --state.committed_bytes;
    if (truncate(path.c_str(), state.committed_bytes) != 0) {
      return InternalError(absl::StrCat("cannot cut ", path, ": ", std::strerror(errno)));
    }
  }
  Entry& entry = entries_[state.id];
  if (!state.complete) entry.file = std::make_shared<UploadFile>(path, state.committed_bytes);
  entry.state = std::move(state);
  return absl::OkStatus();
}

absl::StatusOr<UploadPlace::Added> LocalUploads::Add(UploadState fresh, const Admit& admit) {
  fresh.used = options_.clock();
  // Marks without the lock, since this waits for the disk. If there already is an upload with this id, the mark is
  // harmless: the blob that it stands for exists.
  if (fresh.complete) PLANISH_RETURN_IF_ERROR(MarkComplete(fresh));
  const std::lock_guard lock(mutex_);
  if (const auto found = entries_.find(fresh.id); found != entries_.end()) return Added{found->second.state, false};
  std::vector<UploadState> others;
  for (const auto& [id, entry] : entries_) others.push_back(entry.state);
  PLANISH_RETURN_IF_ERROR(admit(others));
  Entry entry;
  if (!fresh.complete) {
    const std::string path = options_.directory.empty() ? "" : PathOf(fresh, kPart);
    if (!path.empty()) {
      // Creates the file now, so that the upload outlives the process from the first moment on.
      const Descriptor file(open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
      if (file.get() < 0) return WriteError(errno, "cannot begin an upload");
    }
    entry.file = std::make_shared<UploadFile>(path);
  }
  entry.state = fresh;
  entries_[fresh.id] = std::move(entry);
  return Added{std::move(fresh), true};
}

absl::StatusOr<std::optional<UploadState>> LocalUploads::Find(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return std::nullopt;
  return found->second.state;
}

absl::StatusOr<std::vector<UploadState>> LocalUploads::List() {
  std::vector<UploadState> states;
  const std::lock_guard lock(mutex_);
  for (const auto& [id, entry] : entries_) states.push_back(entry.state);
  return states;
}

absl::StatusOr<bool> LocalUploads::Uses(const BlobId& id) {
  const std::lock_guard lock(mutex_);
  return std::any_of(entries_.begin(), entries_.end(),
                     [&](const auto& each) { return each.second.state.Blob() == id; });
}

absl::StatusOr<bool> LocalUploads::Change(const std::string& id, const ChangeState& change, const UploadPiece*) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return false;
  Entry& entry = found->second;
  UploadState changed = entry.state;
  PLANISH_RETURN_IF_ERROR(change(&changed, options_.clock()));
  entry.state = std::move(changed);
  if (entry.state.complete) entry.file = nullptr;
  if (entry.state.writer == 0 && entry.file != nullptr) entry.file->Rest();
  return true;
}

absl::Status LocalUploads::Erase(const UploadState& state, bool if_unused) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(state.id);
  if (found != entries_.end() && if_unused && found->second.state.used != state.used) return absl::OkStatus();
  if (!options_.directory.empty()) {
    unlink(PathOf(state, kPart).c_str());
    unlink(PathOf(state, kDone).c_str());
  }
  if (found != entries_.end()) entries_.erase(found);
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<UploadFile>> LocalUploads::FileOf(const UploadState& state) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(state.id);
  if (found == entries_.end() || found->second.file == nullptr) return UploadNotFound(UploadName(state.id));
  return found->second.file;
}

absl::StatusOr<UploadPiece> LocalUploads::Write(const UploadState& state, std::string_view data) {
  PLANISH_ASSIGN_OR_RETURN(const std::shared_ptr<UploadFile> file, FileOf(state));
  PLANISH_RETURN_IF_ERROR(file->Append(data));
  return UploadPiece{state.committed_bytes, static_cast<std::int64_t>(data.size()), ""};
}

absl::Status LocalUploads::Undo(const UploadState& state, const UploadPiece&) {
  PLANISH_ASSIGN_OR_RETURN(const std::shared_ptr<UploadFile> file, FileOf(state));
  return file->UndoAppend();
}

absl::Status LocalUploads::Finish(const UploadState& state, const UploadPiece&, BlobCatalog* blobs) {
  PLANISH_ASSIGN_OR_RETURN(const std::shared_ptr<UploadFile> file, FileOf(state));
  PLANISH_ASSIGN_OR_RETURN(const std::string digest, file->Digest());
  if (digest != state.sha256) return UploadDigestMismatch(state, digest);
  if (!file->path().empty()) {
    // The mark is written first, since nothing may fail after the file has become the blob. A mark without a blob is
    // removed at the next start.
    PLANISH_RETURN_IF_ERROR(MarkComplete(state));
    return blobs->PutFile(state.Blob(), file->path());
  }
  PLANISH_ASSIGN_OR_RETURN(const BlobPtr bytes, file->Map());
  return blobs->PutDurably(state.Blob(), bytes->bytes());
}

absl::Status LocalUploads::MarkComplete(const UploadState& state) {
  if (options_.directory.empty()) return absl::OkStatus();
  Descriptor mark;
  const std::string path = PathOf(state, kDone);
  if (const int error = options_.files->Open(path, O_WRONLY | O_CREAT, &mark); error != 0) {
    return FileError("create", path, -error);
  }
  return SyncFolder(options_.files, options_.directory);
}

std::string LocalUploads::PathOf(const UploadState& state, const char* suffix) const {
  return absl::StrCat(options_.directory, "/", state.id, "-", state.total_bytes, "-",
                      absl::BytesToHexString(state.sha256), "@", state.tenant, suffix);
}

}  // namespace planish
