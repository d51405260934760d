#include "core/base/thread_team.h"

namespace planish {
namespace {

constexpr std::uint64_t kOpen = 1 << 15;
constexpr std::uint64_t kLoop = 1 << 16;

// How often a helper polls for work before it sleeps: some tens of microseconds, longer than the gaps between the loops
// of one solver iteration.
constexpr int kLooks = 2000;

void Pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

// If a thread cannot be started, the destructor ends the helpers started before: the delegated constructor has run, so
// the object counts as constructed.
ThreadTeam::ThreadTeam(int size) : ThreadTeam() {
  for (int i = 1; i < size; ++i) helpers_.emplace_back([this] { HelperMain(); });
}

ThreadTeam::~ThreadTeam() {
  ending_.store(true);
  bell_.fetch_add(1);
  bell_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void ThreadTeam::WorkOnChunks() {
  for (std::int64_t chunk; (chunk = next_chunk_.fetch_add(1, std::memory_order_relaxed)) < chunks_;) {
    function_(context_, chunk);
  }
}

void ThreadTeam::Run(std::int64_t chunks, ChunkFunction function, const void* context) {
  function_ = function;
  context_ = context;
  chunks_ = chunks;
  next_chunk_.store(0, std::memory_order_relaxed);
  const std::uint64_t loop = door_.load(std::memory_order_relaxed) / kLoop + 1;
  door_.store(loop * kLoop | kOpen, std::memory_order_release);
  bell_.fetch_add(1, std::memory_order_release);
  bell_.notify_all();

  WorkOnChunks();

  // Shut the door and wait for the helpers inside. A helper that has not entered is not waited for.
  std::uint64_t now = door_.fetch_and(~kOpen, std::memory_order_acq_rel) & ~kOpen;
  for (int looks = 0; now % kLoop != 0; now = door_.load(std::memory_order_acquire)) {
    if (++looks < kLooks) {
      Pause();
    } else {
      std::this_thread::yield();
    }
  }
}

void ThreadTeam::HelperMain() {
  std::uint64_t last_loop = 0;
  while (true) {
    const std::uint32_t bell = bell_.load(std::memory_order_acquire);
    std::uint64_t now = 0;
    bool come_in = false;
    for (int looks = 0; looks < kLooks && !come_in; ++looks) {
      if (ending_.load(std::memory_order_relaxed)) return;
      now = door_.load(std::memory_order_acquire);
      come_in = (now & kOpen) != 0 && now / kLoop != last_loop;
      if (!come_in) Pause();
    }
    if (!come_in) {
      bell_.wait(bell);
      continue;
    }
    if (!door_.compare_exchange_strong(now, now + 1, std::memory_order_acq_rel)) continue;
    last_loop = now / kLoop;
    WorkOnChunks();
    door_.fetch_sub(1, std::memory_order_release);
  }
}

ThreadTeam& Alone() {
  thread_local ThreadTeam alone(1);
  return alone;
}

}  // namespace planish
