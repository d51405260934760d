#include "server/farm_stores.h"

#include <fstream>
#include <string>
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

// The password, which is the first line of the file.
absl::StatusOr<std::string> ReadPassword(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  if (file && std::getline(file, line)) {
    if (line.ends_with('\r')) line.pop_back();
    if (!line.empty()) return line;
  }
  return absl::InvalidArgumentError(absl::StrCat("--store-password-file: no password in ", path));
}

absl::StatusOr<std::shared_ptr<BlobStore>> OpenSharedBlobs(const StoreFlags& flags, SqlDatabase* database) {
  if (flags.blobs == "postgresql") return SqlBlobStore::Make(database);
  if (flags.blobs.starts_with('/')) return DirectoryBlobStore::Make({.directory = flags.blobs, .shared = true});
  PLANISH_ASSIGN_OR_RETURN(const S3Place place, ParseS3Place(flags.blobs));
  S3BlobsOptions options;
  options.s3.endpoint =
      flags.s3_endpoint.empty() ? absl::StrCat("https://s3.", flags.s3_region, ".amazonaws.com") : flags.s3_endpoint;
  options.s3.region = flags.s3_region;
  options.s3.bucket = place.bucket;
  options.s3.prefix = place.prefix;
  options.s3.ca_file = flags.s3_ca;
  PLANISH_ASSIGN_OR_RETURN(options.s3.credentials, ReadS3Credentials(flags.s3_credentials));
  return S3BlobStore::Make(std::move(options));
}

// Warns if a promoted standby may lack commits that callers were told about.
absl::Status CheckStandby(SqlDatabase* database) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      connection->Run(
          "SELECT (SELECT count(*) FROM pg_stat_replication), current_setting('synchronous_standby_names'), "
          "current_setting('synchronous_commit')",
          {}));
  const std::string& commit = rows.Bytes(0, 2);
  if (commit == "off") {
    LogWarn(
        "PostgreSQL's synchronous_commit is off: a crash of the database takes back jobs that were accepted and "
        "results "
        "that were told. Set it to on");
  } else if (rows.Int(0, 0) > 0 && (rows.Bytes(0, 1).empty() || commit == "local")) {
    LogWarn(
        "PostgreSQL's standby is asynchronous: if it is promoted, jobs that were accepted last and results that were "
        "told last are lost. Set synchronous_standby_names (deploy/FARM.md)");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<FarmStores> OpenFarmStores(const ServerFlags& flags) {
  FarmStores stores;
  PostgresOptions options;
  options.url = flags.store.url;
  // The number of workers does not matter: one transaction claims work for all of them, and one ends what several have
  // finished. A database has hundreds of connections, not one for each of thousands of workers.
  options.connections = AnswersCallers(flags.store.role) ? 16 : 8;
  options.must_hear = AnswersCallers(flags.store.role);
  if (!flags.store.password_file.empty()) {
    PLANISH_ASSIGN_OR_RETURN(options.password, ReadPassword(flags.store.password_file));
  }
  PLANISH_ASSIGN_OR_RETURN(std::unique_ptr<SqlDatabase> opened, OpenPostgresDatabase(std::move(options)));
  SqlDatabase* const database = opened.get();
  stores.jobs = std::make_unique<JobStore>(std::move(opened));
  PLANISH_RETURN_IF_ERROR(CheckStandby(database));
  PLANISH_ASSIGN_OR_RETURN(stores.registry, ServerRegistry::Make(database));
  PLANISH_ASSIGN_OR_RETURN(stores.blobs, OpenSharedBlobs(flags.store, database));
  PLANISH_ASSIGN_OR_RETURN(stores.uploads, SqlUploads::Make(database, stores.blobs.get()));
  return stores;
}

}  // namespace planish
