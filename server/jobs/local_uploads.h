// Uploads of one server, in a directory or in memory.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/file_layer.h"
#include "server/jobs/upload_file.h"
#include "server/store/upload_place.h"

namespace planish {

struct LocalUploadsOptions {
  // The directory of the uploads, which then outlive the process. It exists, belongs to this object alone, and is on
  // the file system of the blobs' directory. Empty: uploads are in memory.
  std::string directory;
  std::function<absl::Time()> clock;
  FileLayer* files = FileLayer::System();  // for marks of complete uploads
};

// An upload under way is a file with its bytes; a complete one is an empty file, its mark. The file's name has all
// other data about the upload, so that data and bytes never disagree after a crash.
class LocalUploads : public UploadPlace {
 public:
  explicit LocalUploads(LocalUploadsOptions options) : options_(std::move(options)) {}

  absl::Status Open(const std::function<bool(const BlobId& id)>& has_blob) override;
  bool knows_writers() const override { return true; }
  absl::StatusOr<Added> Add(UploadState fresh, const Admit& admit) override;
  absl::StatusOr<std::optional<UploadState>> Find(const std::string& id) override;
  absl::StatusOr<std::vector<UploadState>> List() override;
  absl::StatusOr<bool> Uses(const BlobId& id) override;
  absl::StatusOr<bool> Change(const std::string& id, const ChangeState& change, const UploadPiece* piece) override;
  absl::Status Erase(const UploadState& state, bool if_unused) override;
  absl::StatusOr<UploadPiece> Write(const UploadState& state, std::string_view data) override;
  absl::Status Undo(const UploadState& state, const UploadPiece& piece) override;
  absl::Status Finish(const UploadState& state, const UploadPiece& piece, BlobCatalog* blobs) override;

 private:
  struct Entry {
    UploadState state;
    std::shared_ptr<UploadFile> file;  // null once the upload is complete
  };

  // The path of the upload's file. `suffix`: ".part" for an upload under way, ".done" for a complete one.
  std::string PathOf(const UploadState& state, const char* suffix) const;
  absl::Status Recover(const std::string& file_name, const std::function<bool(const BlobId& id)>& has_blob);
  absl::Status MarkComplete(const UploadState& state);
  absl::StatusOr<std::shared_ptr<UploadFile>> FileOf(const UploadState& state);

  const LocalUploadsOptions options_;
  std::mutex mutex_;
  // Uploads by id. Guarded by mutex_.
  std::unordered_map<std::string, Entry> entries_;
};

}  // namespace planish
