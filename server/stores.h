// The stores of planishd: jobs, blobs and uploads, embedded or shared with other servers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "server/blobs/blob_catalog.h"
#include "server/data_directory.h"
#include "server/disk_room.h"
#include "server/flags.h"
#include "server/jobs/upload_store.h"
#include "server/store/job_store.h"
#include "server/store/server_registry.h"
#include "server/store/sql_uploads.h"

namespace planish {

// The stores that servers of a farm share. Later members use earlier ones.
struct FarmStores {
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<ServerRegistry> registry;
  std::shared_ptr<BlobStore> blobs;
  std::unique_ptr<SqlUploads> uploads;
};

// Opens and sets up the stores that the flags name. UNAVAILABLE with a message for people if one cannot be reached;
// INVALID_ARGUMENT if a file that a flag names cannot be read, or a flag is wrong.
using FarmOpener = std::function<absl::StatusOr<FarmStores>(const ServerFlags& flags)>;

// Later members use earlier ones.
struct Stores {
  FarmStores farm;                         // all null without --store
  std::optional<DataDirectory> directory;  // the data directory, if the flags name one
  std::unique_ptr<DiskRoom> disk;          // null without a data directory
  std::unique_ptr<JobStore> own_jobs;      // null in a farm
  std::unique_ptr<BlobCatalog> blobs;
  std::unique_ptr<UploadStore> uploads;

  JobStore* jobs() const { return farm.jobs != nullptr ? farm.jobs.get() : own_jobs.get(); }
  // Implements JobManagerOptions::disk_shortage.
  absl::StatusOr<std::int64_t> DiskShortage(std::int64_t more) const;
  // Whether an upload refers to the blob or has it as a piece. Also true if the store of uploads does not answer.
  bool IsBlobUsed(const BlobId& id) const;
};

// Opens and sets up the stores that the flags name, by `open_farm` if they name --store. Errors of FarmOpener; also
// UNAVAILABLE if another process owns the data directory.
absl::StatusOr<Stores> OpenStores(const ServerFlags& flags, const TenantLimitsSource& limits,
                                  const FarmOpener& open_farm);

}  // namespace planish
