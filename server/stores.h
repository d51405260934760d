// What planishd keeps, and where: jobs, blobs and uploads, embedded or shared with other servers.
#pragma once

#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "server/blobs/blob_catalog.h"
#include "server/data_directory.h"
#include "server/flags.h"
#include "server/jobs/upload_store.h"
#include "server/store/job_store.h"
#include "server/store/server_registry.h"
#include "server/store/sql_uploads.h"

namespace planish {

// In the order of dependence.
struct Stores {
  std::optional<DataDirectory> directory;    // of an embedded store that outlives the process
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<ServerRegistry> registry;  // of a farm; else null
  std::shared_ptr<BlobStore> shared_blobs;   // likewise
  std::unique_ptr<SqlUploads> shared_uploads;
  std::unique_ptr<BlobCatalog> blobs;
  std::unique_ptr<UploadStore> uploads;

  // Whether an upload needs the blob, or is made of it; true too if that cannot be asked.
  bool IsBlobUsed(const BlobId& id) const;
};

// Opens and sets up what the flags name. UNAVAILABLE with a message for people if something cannot be reached or is
// another process's; INVALID_ARGUMENT if a file that a flag names cannot be read.
absl::StatusOr<Stores> OpenStores(const ServerFlags& flags, const TenantLimitsSource& limits);

}  // namespace planish
