#include "server/worker/process_memory.h"

#include <fcntl.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "core/base/heap.h"
#include "core/base/sanitizers.h"

namespace planish {
namespace {

// Memory that a thread takes in addition to its work: its stack, and memory that the allocator keeps for it.
constexpr std::int64_t kPerThread = std::int64_t{9} << 20;

// Free memory of up to this size is not worth returning to the kernel. glibc keeps up to a page or two more than
// requested.
constexpr std::int64_t kNotWorthTrimming = std::int64_t{64} << 10;

struct Files {
  int statm = -1;
  int status = -1;
  int clear_refs = -1;
};
Files files;

struct Statm {
  std::int64_t resident = 0;  // bytes
  std::int64_t data = 0;      // bytes: heap, stacks and other private memory
};

// Reads /proc/self/statm. All zeros if there is no /proc.
Statm ReadStatm() {
  char text[256] = {};
  if (files.statm < 0 || pread(files.statm, text, sizeof(text) - 1, 0) <= 0) return {};
  long long pages[6] = {};  // size resident shared text lib data
  if (std::sscanf(text, "%lld %lld %lld %lld %lld %lld", &pages[0], &pages[1], &pages[2], &pages[3], &pages[4],
                  &pages[5]) != 6) {
    return {};
  }
  static const long page_size = sysconf(_SC_PAGESIZE);
  return {pages[1] * page_size, pages[5] * page_size};
}

// Free memory at the end of the heap.
std::int64_t FreeEnd() {
  return static_cast<std::int64_t>(mallinfo2().keepcost);
}

void SetSoftLimit(__rlimit_resource resource, rlim_t bytes) {
  rlimit limit = {};
  getrlimit(resource, &limit);
  limit.rlim_cur = std::min(bytes, limit.rlim_max);
  setrlimit(resource, &limit);
}

}  // namespace

void WatchProcessMemory() {
  files.statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  files.status = open("/proc/self/status", O_RDONLY | O_CLOEXEC);
  files.clear_refs = open("/proc/self/clear_refs", O_WRONLY | O_CLOEXEC);
}

std::int64_t HeldBytes() {
  const Statm now = ReadStatm();
  if (kSanitized) return now.resident;
  return std::max(now.resident, now.data) - FreeEnd();
}

std::int64_t PeakMemoryBytes() {
  char text[4096] = {};
  if (files.status >= 0 && pread(files.status, text, sizeof(text) - 1, 0) > 0) {
    const char* const line = std::strstr(text, "\nVmHWM:");
    if (line != nullptr) return std::strtoll(line + std::strlen("\nVmHWM:"), nullptr, 10) * 1024;
  }
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return std::int64_t{usage.ru_maxrss} * 1024;
}

void ResetPeakMemory() {
  // Writing "5" resets the peak only.
  if (files.clear_refs < 0) return;
  [[maybe_unused]] const ssize_t written = write(files.clear_refs, "5", 1);
}

MemoryLimit::MemoryLimit(std::int64_t bytes, std::int64_t expected, int threads) {
  if (kSanitized) return;
  const std::int64_t keep = std::max<std::int64_t>(bytes > 0 ? std::min(expected, bytes) : expected, 0);
  if (FreeEnd() > keep + kNotWorthTrimming) ReturnFreedMemory(static_cast<std::size_t>(keep));
  const std::int64_t held = ReadStatm().data - FreeEnd();
  if (bytes > 0 && held > 0) {
    limited_ = true;
    SetSoftLimit(RLIMIT_DATA, static_cast<rlim_t>(held + bytes + threads * kPerThread));
    SetSoftLimit(RLIMIT_FSIZE, static_cast<rlim_t>(bytes));
  }
  // Asks for huge pages for half of the memory to keep; the rest is used outside this thread's heap.
  ReserveHeap(static_cast<std::size_t>(keep / 2));
}

MemoryLimit::~MemoryLimit() {
  if (!limited_) return;
  SetSoftLimit(RLIMIT_DATA, RLIM_INFINITY);
  SetSoftLimit(RLIMIT_FSIZE, RLIM_INFINITY);
}

}  // namespace planish
