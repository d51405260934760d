#include "server/stores.h"

#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/blobs/directory_blobs.h"
#include "server/blobs/s3_blobs.h"
#include "server/log/log.h"
#include "server/store/sql.h"
#include "server/store/sql_blobs.h"

namespace planish {
namespace {

// What the file says up to the end of its first line.
absl::StatusOr<std::string> ReadPassword(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  if (file && std::getline(file, line)) {
    if (line.ends_with('\r')) line.pop_back();
    if (!line.empty()) return line;
  }
  return absl::InvalidArgumentError(absl::StrCat("--store-password-file: there is no password in ", path));
}

absl::StatusOr<std::shared_ptr<BlobStore>> OpenSharedBlobs(const StoreFlags& flags, SqlDatabase* database) {
  if (flags.blobs == "postgresql") return SqlBlobStore::Make(database);
  if (flags.blobs.starts_with('/')) return DirectoryBlobStore::Make({.directory = flags.blobs, .shared = true});
  PLANISH_ASSIGN_OR_RETURN(const S3Place place, ParseS3Place(flags.blobs));
  S3BlobsOptions options;
  options.s3.endpoint = flags.s3_endpoint.empty() ? absl::StrCat("https://s3.", flags.s3_region, ".amazonaws.com")
                                                  : flags.s3_endpoint;
  options.s3.region = flags.s3_region;
  options.s3.bucket = place.bucket;
  options.s3.prefix = place.prefix;
  options.s3.ca_file = flags.s3_ca;
  PLANISH_ASSIGN_OR_RETURN(options.s3.credentials, ReadS3Credentials(flags.s3_credentials));
  return S3BlobStore::Make(std::move(options));
}

// The jobs of a farm, and all else that is in its database.
absl::Status OpenFarm(const ServerFlags& flags, Stores* stores, BlobPlaces* places) {
  PostgresOptions options;
  options.url = flags.store.url;
  // A thread of each worker may ask something, and so may those that answer calls.
  options.connections = flags.workers + 8;
  if (!flags.store.password_file.empty()) {
    PLANISH_ASSIGN_OR_RETURN(options.password, ReadPassword(flags.store.password_file));
  }
  PLANISH_ASSIGN_OR_RETURN(std::unique_ptr<SqlDatabase> opened, OpenPostgresDatabase(std::move(options)));
  SqlDatabase* const database = opened.get();
  stores->jobs = NewJobStore(std::move(opened));
  PLANISH_ASSIGN_OR_RETURN(stores->registry, ServerRegistry::Make(database));
  PLANISH_ASSIGN_OR_RETURN(stores->shared_blobs, OpenSharedBlobs(flags.store, database));
  PLANISH_ASSIGN_OR_RETURN(stores->shared_uploads, SqlUploads::Make(database, stores->shared_blobs.get()));
  places->store = stores->shared_blobs;
  return absl::OkStatus();
}

absl::Status OpenEmbedded(const std::string& data_dir, Stores* stores, BlobPlaces* places) {
  if (data_dir.empty()) {
    PLANISH_ASSIGN_OR_RETURN(stores->jobs, OpenJobStore(":memory:"));
    return absl::OkStatus();
  }
  PLANISH_ASSIGN_OR_RETURN(stores->directory, DataDirectory::Take(data_dir));
  PLANISH_ASSIGN_OR_RETURN(stores->jobs, OpenJobStore(stores->directory->jobs()));
  PLANISH_ASSIGN_OR_RETURN(places->store, DirectoryBlobStore::Make({.directory = stores->directory->blobs()}));
  return absl::OkStatus();
}

UploadStoreOptions UploadOptions(const ServerFlags& flags, const Stores& stores) {
  UploadStoreOptions options;
  options.place = stores.shared_uploads.get();
  if (stores.directory.has_value()) options.directory = stores.directory->uploads();
  options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  options.max_bytes = flags.max_uploads_mb * kMiB;
  return options;
}

}  // namespace

absl::StatusOr<Stores> OpenStores(const ServerFlags& flags, const TenantLimitsSource& limits) {
  Stores stores;
  BlobPlaces places;
  PLANISH_RETURN_IF_ERROR(flags.store.is_farm() ? OpenFarm(flags, &stores, &places)
                                                : OpenEmbedded(flags.store.data_dir, &stores, &places));
  places.rows = stores.jobs->rows();
  stores.blobs = std::make_unique<BlobCatalog>(std::move(places), flags.store_mb * kMiB, limits);
  stores.blobs->SetOnDamage([](const absl::Status& status) { LogError(status.message()); });
  PLANISH_RETURN_IF_ERROR(stores.blobs->Open());
  stores.uploads = std::make_unique<UploadStore>(UploadOptions(flags, stores), stores.blobs.get());
  PLANISH_RETURN_IF_ERROR(stores.uploads->Open());
  return stores;
}

bool Stores::IsBlobUsed(const BlobId& id) const {
  if (shared_uploads != nullptr && SqlUploads::IsPart(id)) return shared_uploads->UsesPart(id).value_or(true);
  return uploads->Uses(id);
}

}  // namespace planish
