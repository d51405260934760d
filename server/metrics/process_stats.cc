#include "server/metrics/process_stats.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

namespace planish {
namespace {

double CpuSeconds(int who) {
  rusage usage;
  if (getrusage(who, &usage) != 0) return 0;
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// Field 22 of /proc/self/stat is in ticks since the machine started, which is btime in /proc/stat.
double StartTime() {
  std::ifstream stat("/proc/self/stat");
  std::string line;
  std::getline(stat, line);
  const std::size_t name_end = line.rfind(')');  // the name in field 2 may contain any character
  if (name_end == std::string::npos) return 0;
  std::istringstream fields(line.substr(name_end + 1));
  std::string skipped;
  for (int field = 3; field < 22; ++field) fields >> skipped;
  double ticks = 0;
  fields >> ticks;
  std::ifstream machine("/proc/stat");
  for (std::string word; machine >> word;) {
    double boot = 0;
    if (word == "btime" && machine >> boot) return boot + ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
  }
  return 0;
}

std::int64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::int64_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

std::int64_t OpenDescriptors() {
  std::error_code error;
  std::int64_t count = -1;  // without the descriptor that reads the directory
  for (std::filesystem::directory_iterator it("/proc/self/fd", error), end; !error && it != end; it.increment(error)) {
    ++count;
  }
  return count < 0 ? 0 : count;
}

}  // namespace

ProcessStats ReadProcessStats() {
  static const double start_time = StartTime();
  ProcessStats stats;
  stats.start_time = start_time;
  stats.cpu_seconds = CpuSeconds(RUSAGE_SELF);
  stats.ended_child_seconds = CpuSeconds(RUSAGE_CHILDREN);
  stats.resident_bytes = ResidentBytes();
  stats.open_descriptors = OpenDescriptors();
  rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0) stats.max_descriptors = static_cast<std::int64_t>(limit.rlim_cur);
  return stats;
}

}  // namespace planish
