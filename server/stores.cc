#include "server/stores.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/blobs/directory_blobs.h"
#include "server/log/log.h"

namespace planish {
namespace {

absl::Status OpenEmbedded(const ServerFlags& flags, Stores* stores, BlobPlaces* places) {
  const std::string& data_dir = flags.store.data_dir;
  if (data_dir.empty()) {
    PLANISH_ASSIGN_OR_RETURN(stores->own_jobs, OpenJobStore(":memory:"));
    return absl::OkStatus();
  }
  PLANISH_ASSIGN_OR_RETURN(stores->directory, DataDirectory::Take(data_dir));
  stores->disk = std::make_unique<DiskRoom>(data_dir, flags.headroom_mb * kMiB);
  absl::StatusOr<std::unique_ptr<JobStore>> jobs =
      OpenJobStore(stores->directory->jobs(), [disk = stores->disk.get()] { return disk->GiveUpReserve(); });
  if (ErrorInfoOf(jobs.status()).reason == "STORAGE_FULL") {
    return absl::UnavailableError(absl::StrCat(
        "the disk of ", data_dir, " is full, and the server cannot even open its store: ", jobs.status().message(),
        ". Free some MiB there (deploy/OPERATION.md)"));
  }
  PLANISH_RETURN_IF_ERROR(jobs.status());
  stores->own_jobs = *std::move(jobs);
  PLANISH_RETURN_IF_ERROR(stores->directory->Remember());
  PLANISH_ASSIGN_OR_RETURN(places->store, DirectoryBlobStore::Make({.directory = stores->directory->blobs()}));
  return absl::OkStatus();
}

UploadStoreOptions UploadOptions(const ServerFlags& flags, const Stores& stores) {
  UploadStoreOptions options;
  options.place = stores.farm.uploads.get();
  if (stores.directory.has_value()) options.directory = stores.directory->uploads();
  options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  options.max_bytes = flags.max_uploads_mb * kMiB;
  return options;
}

}  // namespace

absl::StatusOr<Stores> OpenStores(const ServerFlags& flags, const TenantLimitsSource& limits,
                                  const FarmOpener& open_farm) {
  Stores stores;
  BlobPlaces places;
  if (flags.store.is_farm()) {
    PLANISH_ASSIGN_OR_RETURN(stores.farm, open_farm(flags));
    places.store = stores.farm.blobs;
  } else {
    PLANISH_RETURN_IF_ERROR(OpenEmbedded(flags, &stores, &places));
  }
  places.rows = stores.jobs()->rows();
  stores.blobs = std::make_unique<BlobCatalog>(std::move(places), flags.store_mb * kMiB, limits);
  stores.blobs->SetOnDamage([](const absl::Status& status) { LogError(status.message()); });
  PLANISH_RETURN_IF_ERROR(stores.blobs->Open());
  stores.uploads = std::make_unique<UploadStore>(UploadOptions(flags, stores), stores.blobs.get());
  PLANISH_RETURN_IF_ERROR(stores.uploads->Open());
  return stores;
}

absl::StatusOr<std::int64_t> Stores::DiskShortage(std::int64_t more) const {
  if (directory.has_value()) PLANISH_RETURN_IF_ERROR(directory->Check());
  return disk == nullptr ? 0 : disk->Shortage(more);
}

bool Stores::IsBlobUsed(const BlobId& id) const {
  if (farm.uploads != nullptr && SqlUploads::IsPart(id)) return farm.uploads->UsesPart(id).value_or(true);
  return uploads->Uses(id);
}

}  // namespace planish
