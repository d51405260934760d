// Blobs as files in a directory.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/blob_store.h"
#include "server/blobs/file_layer.h"

namespace planish {

struct DirectoryBlobsOptions {
  std::string directory;  // exists
  // Whether several processes use the directory, on one machine or on many (NFS). Otherwise only this process does, and
  // incomplete files are removed at once.
  bool shared = false;
  FileLayer* files = FileLayer::System();  // not null, outlives the store
};

// A blob is a file named by its digest, in a folder named by the digest's first byte; each tenant except the default
// one has a folder of its own for these. A file is written under another name, synced, renamed, and its folder synced.
// Renaming, syncing the folder and removing happen under a lock for all folders with the same first byte. In a shared
// directory that is a lock on one byte of the file `lock` beside the folders, which the kernel and NFS enforce between
// processes and machines, and which is released when its process ends.
class DirectoryBlobStore : public BlobStore {
 public:
  // Finds the blobs of earlier processes and makes them durable: these may have ended before they synced a folder.
  static absl::StatusOr<std::unique_ptr<DirectoryBlobStore>> Make(DirectoryBlobsOptions options);

  absl::StatusOr<bool> Renew(const BlobId& id) override;
  absl::StatusOr<bool> Has(const BlobId& id) override;
  absl::Status List(const std::function<void(const BlobEntry&)>& visit) override;
  absl::StatusOr<bool> Remove(const BlobId& id, absl::Duration min_age) override;
  bool is_shared() const override { return options_.shared; }

 protected:
  absl::StatusOr<Found> OpenUnverified(const BlobId& id) override;
  absl::StatusOr<std::string> PutNew(const BlobId& id, std::string_view bytes) override;
  absl::StatusOr<std::string> PutNewFile(const BlobId& id, const std::string& path) override;
  absl::Status Drop(const BlobId& id, const std::string& version) override;

 private:
  static constexpr int kShards = 256;

  // Locks the shard of a blob as long as the object lives.
  class ShardLock;

  explicit DirectoryBlobStore(DirectoryBlobsOptions options) : options_(std::move(options)) {}

  absl::Status SetUp();
  std::string FolderOf(const BlobId& id) const;
  std::string PathOf(const BlobId& id) const;
  // The current time. In a shared directory it is that of the file system, whose clock is the same for all machines.
  absl::StatusOr<absl::Time> Now() const;
  absl::Status WriteFile(const std::string& path, std::string_view bytes);
  // Renames the file `path`, already synced, to be the blob. Returns its version. After an error the file is unchanged.
  absl::StatusOr<std::string> Install(const BlobId& id, const std::string& path);

  const DirectoryBlobsOptions options_;
  Descriptor lock_file_;                    // constant after SetUp(); none unless shared
  std::array<std::mutex, kShards> shards_;  // lock a shard between the threads of this process
};

}  // namespace planish
