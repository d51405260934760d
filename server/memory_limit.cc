#include "server/memory_limit.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>

#include "absl/strings/numbers.h"

namespace planish {
namespace {

std::string ReadText(const char* path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

}  // namespace

std::int64_t ParseMemoryLimit(const std::string& meminfo, const std::string& cgroup_max) {
  std::int64_t limit = std::numeric_limits<std::int64_t>::max();
  std::istringstream lines(meminfo);
  std::string key;
  std::int64_t kib = 0;
  while (lines >> key) {
    if (key == "MemTotal:" && lines >> kib) {
      limit = kib * 1024;
      break;
    }
  }
  std::int64_t group = 0;  // "max" means no limit
  if (absl::SimpleAtoi(cgroup_max, &group) && group > 0) limit = std::min(limit, group);
  return limit;
}

std::int64_t MemoryLimit() {
  // Inside a container, the container's own group is mounted as the root.
  return ParseMemoryLimit(ReadText("/proc/meminfo"), ReadText("/sys/fs/cgroup/memory.max"));
}

}  // namespace planish
