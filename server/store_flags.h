// The flags of planishd about where jobs and blobs are, and what this server does for them.
#pragma once

#include <string>

#include "CLI/App.hpp"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

enum class Role {
  kAll,     // answers callers and runs jobs
  kFront,   // answers callers
  kWorker,  // runs jobs
};

constexpr bool AnswersCallers(Role role) {
  return role != Role::kWorker;
}
constexpr bool RunsJobs(Role role) {
  return role != Role::kFront;
}

struct StoreFlags {
  Role role = Role::kAll;
  std::string data_dir;              // of an embedded store; empty: in memory, which ends with the process
  std::string url;                   // of PostgreSQL; empty: an embedded store
  std::string password_file;         // empty: none
  std::string blobs = "postgresql";  // "postgresql", "s3://BUCKET[/PREFIX]", or a directory; of a farm
  std::string s3_endpoint;           // empty: that of AWS
  std::string s3_region = "us-east-1";
  std::string s3_credentials;  // empty: from the environment
  std::string s3_ca;           // empty: those of the system
  double lease_seconds = 15;   // of work that runs, > 0

  // Whether other servers use the same store.
  bool is_farm() const { return !url.empty(); }
  // Whether jobs outlive this process.
  bool is_durable() const { return is_farm() || !data_dir.empty(); }
};

void DefineStore(CLI::App* app, StoreFlags* flags);

// What the flags say together, after they were parsed. INVALID_ARGUMENT, in words, if that makes no sense.
absl::Status CheckStore(const StoreFlags& flags);

// StoreFlags::blobs that begin with "s3://" taken apart.
struct S3Place {
  std::string bucket, prefix;  // of all keys, without a slash at either end; may be empty
};
absl::StatusOr<S3Place> ParseS3Place(const std::string& blobs);

}  // namespace planish
