// Many jobs of all kinds while the server and its workers are killed at random.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/testing/daemon.h"

namespace planish {

struct ChaosOptions {
  int jobs = 60;
  int callers = 8;                  // at a time
  int kills = 10;                   // of the server or of a worker, half and half
  double cancelled = 0.1;           // part of the jobs that their caller cancels
  double malformed = 0.05;          // part of the jobs whose mesh is broken
  int largest_grid = 40;            // a mesh has at most twice the square of this many triangles
  double kill_pause_seconds = 0.3;  // on average between two kills
  std::uint32_t seed = 1;
};

struct ChaosReport {
  int accepted = 0;                 // jobs
  std::map<std::string, int> ends;  // "SUCCEEDED", "CANCELLED", "FAILED MESH_DECODE_FAILED", ...: how many
  int server_kills = 0;
  int worker_kills = 0;
  double seconds = 0;
  double slowest_restart_seconds = 0;
  int descriptors_before = 0, descriptors_after = 0;  // of the server, idle
  std::int64_t resident_bytes = 0;                    // at the end
  std::vector<std::string> wrong;                     // every promise that was broken, in words; empty: none
};

// Promises looked at: every accepted job ends; none succeeds twice or changes after its end; every result has UV of its
// own mesh without flipped triangles; what is cancelled or malformed ends as such; afterwards there are no zombies, no
// more descriptors than before and, once the jobs are deleted, no blobs.
ChaosReport RunChaos(const ChaosOptions& options, DurableServer& server);

}  // namespace planish
