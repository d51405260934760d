// The flags of planishd about the store, the blobs, and the server's role.
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
  std::string data_dir;              // of an embedded store; empty: in memory, lost with the process
  std::string url;                   // of PostgreSQL; empty: an embedded store
  std::string password_file;         // empty: none
  std::string blobs = "postgresql";  // "postgresql", "s3://BUCKET[/PREFIX]", or a directory; of a farm
  std::string s3_endpoint;           // empty: AWS
  std::string s3_region = "us-east-1";
  std::string s3_credentials;  // empty: from the environment
  std::string s3_ca;           // empty: the CAs of the system
  double lease_seconds = 15;   // duration of the leases of running work, > 0

  // Whether other servers may use the same store.
  bool is_farm() const { return !url.empty(); }
  // Whether jobs outlive this process.
  bool is_durable() const { return is_farm() || !data_dir.empty(); }
};

void DefineStore(CLI::App* app, StoreFlags* flags);

// Checks the combination of flags after parsing. INVALID_ARGUMENT, with a message for people, if they contradict each
// other.
absl::Status CheckStore(const StoreFlags& flags);

// The parts of a StoreFlags::blobs that begins with "s3://".
struct S3Place {
  std::string bucket, prefix;  // the prefix of all keys has no slash at either end, and may be empty
};
absl::StatusOr<S3Place> ParseS3Place(const std::string& blobs);

}  // namespace planish
