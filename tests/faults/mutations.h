// Damaged meshes and damaged messages against a real planishd, over bare gRPC.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/testing/daemon.h"

namespace planish {

struct MutationOptions {
  int inputs = 300;
  int callers = 4;  // at a time
  std::uint32_t seed = 1;
  double call_seconds = 120;  // after which an answer or the end of a job counts as missing
};

struct MutationReport {
  int sent = 0;
  int accepted = 0;                    // that became jobs
  std::map<std::string, int> refused;  // the others: "CreateJob INVALID_ARGUMENT MESH_DECODE_FAILED", "GetJob OK", ...
  std::map<std::string, int> ends;     // of jobs: "SUCCEEDED", "FAILED MESH_CLOSED", ...
  double seconds = 0;
  int descriptors_before = 0, descriptors_after = 0;  // of the server, idle
  std::int64_t resident_bytes = 0;                    // at the end
  std::vector<std::string> wrong;                     // every promise that was broken, in words; empty: none
};

// Each input is a request whose Draco data, or some of whose fields, or whose bytes, or several of these are damaged;
// more than half of them are to create jobs, the others go to the other calls. Promises looked at: the server lives;
// every call is answered, never with INTERNAL or UNKNOWN unless the bytes are no message; every accepted job ends;
// nothing leaks. The same inputs for the same seed.
MutationReport RunMutations(const MutationOptions& options, DurableServer& server);

}  // namespace planish
