#include "server/blobs/blob_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/blobs/file_layer.h"
#include "server/blobs/running_sha256.h"

namespace planish {
namespace {

constexpr std::int64_t kPieceBytes = std::int64_t{1} << 20;

// Number of verified versions to remember. When it is reached all are forgotten, and blobs are verified again.
constexpr std::size_t kMostVerified = 65536;

// Attempts at an operation, since another process may put, drop or remove the same blob between two steps.
constexpr int kTries = 3;

std::string KeyOf(const BlobId& id) {
  return id.tenant + "/" + id.sha256;
}

// Reads the blob, and copies its bytes to `copy` unless that is null. DATA_LOSS if they do not match the digest.
absl::Status Compare(const BlobId& id, const StoredBlob& blob, char* copy) {
  RunningSha256 hash;
  std::string piece;
  const std::int64_t size = blob.size();
  for (std::int64_t offset = 0; offset < size; offset += kPieceBytes) {
    PLANISH_RETURN_IF_ERROR(blob.Read(offset, std::min(size - offset, kPieceBytes), &piece));
    hash.Update(piece);
    if (copy != nullptr) std::copy(piece.begin(), piece.end(), copy + offset);
  }
  return hash.Digest() == id.sha256 ? absl::OkStatus() : BlobDamaged(id, "they have another digest");
}

}  // namespace

absl::Status BlobNotFound(const BlobId& id) {
  return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND",
                   absl::StrCat("the store has no bytes with SHA-256 ", absl::BytesToHexString(id.sha256)));
}

absl::Status BlobDamaged(const BlobId& id, const std::string& how) {
  return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED",
                   absl::StrCat("the store had damaged bytes in place of those with SHA-256 ",
                                absl::BytesToHexString(id.sha256), ": ", how));
}

bool IsLost(const absl::Status& status) {
  return absl::IsNotFound(status) || absl::IsDataLoss(status);
}

absl::StatusOr<bool> BlobStore::IsThere(const BlobId& id) {
  absl::Status lost;
  for (int i = 0; i < kTries; ++i) {
    PLANISH_ASSIGN_OR_RETURN(const bool is_there, Renew(id));
    if (!is_there) return false;
    lost = Open(id).status();
    if (lost.ok()) return true;
    if (!IsLost(lost)) return lost;
  }
  return lost;
}

absl::Status BlobStore::Put(const BlobId& id, std::string_view bytes) {
  PLANISH_ASSIGN_OR_RETURN(const bool is_there, IsThere(id));
  if (is_there) return absl::OkStatus();
  PLANISH_ASSIGN_OR_RETURN(const std::string version, PutNew(id, bytes));
  SetVerified(id, version);
  return absl::OkStatus();
}

absl::Status BlobStore::PutFile(const BlobId& id, const std::string& path) {
  PLANISH_ASSIGN_OR_RETURN(const bool is_there, IsThere(id));
  if (is_there) {
    FileLayer::System()->Remove(path);
    return absl::OkStatus();
  }
  PLANISH_ASSIGN_OR_RETURN(const std::string version, PutNewFile(id, path));
  SetVerified(id, version);
  return absl::OkStatus();
}

absl::StatusOr<std::string> BlobStore::PutNewFile(const BlobId& id, const std::string& path) {
  FileLayer* const files = FileLayer::System();
  Descriptor file;
  if (const int error = files->Open(path, O_RDONLY, &file); error != 0) return FileError("open", path, -error);
  const off_t size = lseek(file.get(), 0, SEEK_END);
  if (size < 0) return FileError("measure", path, errno);
  PLANISH_ASSIGN_OR_RETURN(BlobWriter memory, BlobWriter::Make(static_cast<std::size_t>(size)));
  PLANISH_RETURN_IF_ERROR(StoredBlob::ReadFile(files, file.get(), 0, size, memory.data()));
  PLANISH_ASSIGN_OR_RETURN(std::string version, PutNew(id, {memory.data(), memory.size()}));
  files->Remove(path);
  return version;
}

absl::StatusOr<StoredBlobPtr> BlobStore::Open(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(Found found, OpenUnverified(id));
  if (!IsVerified(id, found.version)) PLANISH_RETURN_IF_ERROR(Verify(id, found, nullptr));
  return std::move(found.blob);
}

absl::StatusOr<BlobPtr> BlobStore::Load(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const Found found, OpenUnverified(id));
  PLANISH_ASSIGN_OR_RETURN(BlobWriter memory, BlobWriter::Make(static_cast<std::size_t>(found.blob->size())));
  PLANISH_RETURN_IF_ERROR(Verify(id, found, memory.data()));
  return memory.Finish();
}

absl::Status BlobStore::Verify(const BlobId& id, const Found& found, char* copy) {
  absl::Status status = Compare(id, *found.blob, copy);
  // Reads the bytes again if they differ, since they may have been damaged in transit: a good blob must not be dropped
  // for that.
  if (absl::IsDataLoss(status)) status = Compare(id, *found.blob, copy);
  if (absl::IsDataLoss(status)) PLANISH_RETURN_IF_ERROR(Drop(id, found.version));
  if (status.ok()) SetVerified(id, found.version);
  return status;
}

bool BlobStore::IsVerified(const BlobId& id, const std::string& version) {
  const std::lock_guard lock(mutex_);
  const auto entry = verified_.find(KeyOf(id));
  return entry != verified_.end() && entry->second == version;
}

void BlobStore::SetVerified(const BlobId& id, const std::string& version) {
  if (version.empty()) return;  // another process put the bytes
  const std::lock_guard lock(mutex_);
  if (verified_.size() >= kMostVerified) verified_.clear();
  verified_[KeyOf(id)] = version;
}

absl::StatusOr<std::int64_t> CollectBlobs(BlobStore* store, absl::Duration min_age,
                                          const std::function<absl::StatusOr<bool>(const BlobId& id)>& is_used) {
  std::vector<BlobId> old;
  PLANISH_RETURN_IF_ERROR(store->List([&](const BlobEntry& entry) {
    if (entry.age >= min_age) old.push_back(entry.id);
  }));
  std::int64_t removed = 0;
  absl::Status last;
  for (const BlobId& id : old) {
    PLANISH_ASSIGN_OR_RETURN(const bool used, is_used(id));
    if (used) continue;
    if (const absl::StatusOr<bool> gone = store->Remove(id, min_age); gone.ok()) {
      removed += *gone ? 1 : 0;
    } else {
      last = gone.status();
    }
  }
  if (!last.ok()) return last;
  return removed;
}

}  // namespace planish
