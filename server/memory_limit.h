#pragma once

#include <cstdint>
#include <string>

namespace planish {

// Bytes of memory that this process and its children may use: the machine's, or less where a control group (a
// container) says so.
std::int64_t MemoryLimit();

// The lower of what `meminfo` (as /proc/meminfo) and `cgroup_max` (as memory.max, empty where there is none) say.
std::int64_t ParseMemoryLimit(const std::string& meminfo, const std::string& cgroup_max);

}  // namespace planish
