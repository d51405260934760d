#pragma once

#include <cstdint>
#include <string>

namespace planish {

// Bytes of memory that this process and its children may use: those of the machine, or the limit of the control group
// (the container) if that is lower.
std::int64_t MemoryLimit();

// The lower of the limits in `meminfo` (the text of /proc/meminfo) and `cgroup_max` (the text of memory.max; empty if
// there is none).
std::int64_t ParseMemoryLimit(const std::string& meminfo, const std::string& cgroup_max);

}  // namespace planish
