#include "server/store_flags.h"

#include <algorithm>
#include <string_view>

#include "CLI/CLI.hpp"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/config/choice.h"

namespace planish {
namespace {

constexpr std::string_view kS3 = "s3://";

// Whether the URL has the form postgresql://USER:PASSWORD@..., or a parameter `password`.
bool HoldsPassword(const std::string& url) {
  if (const std::size_t scheme = url.find("://"); scheme != std::string::npos) {
    const std::size_t begin = scheme + 3;
    const std::string authority = url.substr(begin, url.find('/', begin) - begin);
    const std::size_t at = authority.rfind('@');
    if (at != std::string::npos && authority.find(':') < at) return true;
  }
  for (const char* const key : {" password=", "?password=", "&password="}) {
    if ((" " + url).find(key) != std::string::npos) return true;
  }
  return false;
}

}  // namespace

void DefineStore(CLI::App* app, StoreFlags* flags) {
  AddChoice<Role>(app, "--role", &flags->role,
                  {{"all", Role::kAll}, {"front", Role::kFront}, {"worker", Role::kWorker}},
                  "Whether this server answers callers, runs jobs, or does both; only in a farm (--store) it may do "
                  "one. A worker listens only on --metrics-listen; settings of the other role have no effect");
  app->add_option("--data-dir", flags->data_dir,
                  "Directory for jobs, meshes and results, which then outlive the server. Without it, and without "
                  "--store, they are in memory")
      ->type_name("DIR");
  app->add_option("--store", flags->url,
                  "PostgreSQL that any number of servers share: postgresql://USER@HOST/DATABASE, with libpq's "
                  "parameters for TLS (sslmode, sslrootcert) and several hosts")
      ->type_name("URL");
  app->add_option("--store-password-file", flags->password_file, "File with the password for --store")
      ->type_name("FILE");
  app->add_option("--blobs", flags->blobs,
                  "Where servers that share --store keep meshes and UV: postgresql, s3://BUCKET/PREFIX, or a directory "
                  "that all of them mount")
      ->capture_default_str()
      ->type_name("PLACE");
  app->add_option("--lease", flags->lease_seconds,
                  "Seconds after which the jobs of a server that no longer responds go to another server")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 3600.0));
  app->add_option("--s3-endpoint", flags->s3_endpoint, "https://HOST[:PORT] of the S3 server [AWS]")->type_name("URL");
  app->add_option("--s3-region", flags->s3_region, "Region of the bucket")->capture_default_str()->type_name("NAME");
  app->add_option("--s3-credentials", flags->s3_credentials,
                  "File with aws_access_key_id and aws_secret_access_key, in the format of the AWS command line [the "
                  "variables AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN]")
      ->type_name("FILE");
  app->add_option("--s3-ca", flags->s3_ca, "CA of the S3 server's certificate, PEM [the CAs of the system]")
      ->type_name("FILE");
}

absl::StatusOr<S3Place> ParseS3Place(const std::string& blobs) {
  const std::string rest = blobs.substr(std::min(blobs.size(), kS3.size()));
  const std::size_t slash = rest.find('/');
  S3Place place = {rest.substr(0, slash), ""};
  if (slash != std::string::npos) place.prefix = rest.substr(slash + 1);
  while (place.prefix.ends_with('/')) place.prefix.pop_back();
  if (place.bucket.empty() || place.prefix.starts_with('/')) {
    return absl::InvalidArgumentError(
        absl::StrCat("--blobs: '", blobs, "' does not name a bucket: write s3://BUCKET or s3://BUCKET/PREFIX"));
  }
  return place;
}

absl::Status CheckStore(const StoreFlags& flags) {
  if (!flags.is_farm()) {
    const char* const needs_store = flags.role != Role::kAll       ? "--role"
                                    : !flags.password_file.empty() ? "--store-password-file"
                                    : flags.blobs != "postgresql"  ? "--blobs"
                                                                   : "";
    if (*needs_store == 0) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat(needs_store, " needs --store: the PostgreSQL that the servers of a farm share"));
  }
  if (!flags.data_dir.empty()) {
    return absl::InvalidArgumentError("--data-dir and --store cannot be combined: jobs are in one or the other");
  }
  if (HoldsPassword(flags.url)) {
    return absl::InvalidArgumentError(
        "--store: the URL contains a password, which everybody on this machine could read: put it into a file and give "
        "--store-password-file");
  }
  if (flags.blobs == "postgresql" || flags.blobs.starts_with('/')) return absl::OkStatus();
  if (flags.blobs.starts_with(kS3)) return ParseS3Place(flags.blobs).status();
  return absl::InvalidArgumentError(
      absl::StrCat("--blobs: '", flags.blobs, "' is not postgresql, s3://BUCKET/PREFIX or /DIRECTORY"));
}

}  // namespace planish
