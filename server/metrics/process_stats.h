#pragma once

#include <cstdint>

namespace planish {

// Figures of this process, as the kernel counts; 0 if it does not tell.
struct ProcessStats {
  double start_time = 0;           // Unix time, seconds
  double cpu_seconds = 0;          // user and system
  double ended_child_seconds = 0;  // user and system time of children that were waited for
  std::int64_t resident_bytes = 0;
  std::int64_t open_descriptors = 0;
  std::int64_t max_descriptors = 0;
};

ProcessStats ReadProcessStats();

}  // namespace planish
