// Threads for the loops of one caller. Results do not depend on the number of threads.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <type_traits>
#include <vector>

namespace planish {

// The calling thread and `size - 1` helpers. Loops are cut into chunks of a fixed size, whatever the size of the team,
// and one thread runs each chunk. So a loop whose chunks do not read what others write gives the same bits with any
// team. Helpers poll for some microseconds after each loop, then sleep.
//
// One thread at a time may use a team. Bodies must not throw and must not use the team themselves.
class ThreadTeam {
 public:
  // Iterations of a chunk: at most some milliseconds of work on a mesh, and enough to pay for a thread.
  static constexpr std::int64_t kChunk = 4096;

  // size >= 1.
  explicit ThreadTeam(int size);
  ~ThreadTeam();
  ThreadTeam(const ThreadTeam&) = delete;
  ThreadTeam& operator=(const ThreadTeam&) = delete;

  int size() const { return static_cast<int>(helpers_.size()) + 1; }

  // Calls body(begin, end) for every chunk of [0, n), in any order and from any thread.
  template <typename Body>
  void For(std::int64_t n, std::int64_t chunk_size, const Body& body) {
    const std::int64_t chunks = (n + chunk_size - 1) / chunk_size;
    const auto run_chunk = [&](std::int64_t chunk) {
      const std::int64_t begin = chunk * chunk_size;
      body(begin, begin + chunk_size < n ? begin + chunk_size : n);
    };
    if (helpers_.empty() || chunks < 2) {
      for (std::int64_t chunk = 0; chunk < chunks; ++chunk) run_chunk(chunk);
    } else {
      using Function = std::remove_reference_t<decltype(run_chunk)>;
      Run(
          chunks, [](const void* f, std::int64_t chunk) { (*static_cast<const Function*>(f))(chunk); }, &run_chunk);
    }
  }

  // Calls each(i) for every i of [0, n). The indices of a chunk run in order on one thread.
  template <typename Each>
  void ForEach(std::int64_t n, const Each& each, std::int64_t chunk_size = kChunk) {
    For(n, chunk_size, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t i = begin; i < end; ++i) each(i);
    });
  }

  // For(), while one thread also runs task(), which starts first. `task` must not write what the chunks read.
  template <typename Body, typename Task>
  void ForBeside(const Task& task, std::int64_t n, std::int64_t chunk_size, const Body& body) {
    For(1 + (n + chunk_size - 1) / chunk_size, 1, [&](std::int64_t item, std::int64_t) {
      if (item == 0) return task();
      const std::int64_t begin = (item - 1) * chunk_size;
      body(begin, begin + chunk_size < n ? begin + chunk_size : n);
    });
  }

  // The results of body(begin, end) for every chunk, in order.
  template <typename Result, typename Body>
  std::vector<Result> Collect(std::int64_t n, std::int64_t chunk_size, const Body& body) {
    std::vector<Result> results(static_cast<std::size_t>((n + chunk_size - 1) / chunk_size));
    For(n, chunk_size, [&](std::int64_t begin, std::int64_t end) {
      results[static_cast<std::size_t>(begin / chunk_size)] = body(begin, end);
    });
    return results;
  }

  // Sum over all chunks of body(begin, end), added in order.
  template <typename Body>
  double Sum(std::int64_t n, std::int64_t chunk_size, const Body& body) {
    double sum = 0;
    for (const double part : Collect<double>(n, chunk_size, body)) sum += part;
    return sum;
  }

 private:
  using ChunkFunction = void (*)(const void* context, std::int64_t chunk);

  ThreadTeam() = default;
  void Run(std::int64_t chunks, ChunkFunction function, const void* context);
  void WorkOnChunks();
  void HelperMain();

  std::vector<std::thread> helpers_;

  // The current loop. The caller writes it while `door_` is shut and no helper is inside.
  ChunkFunction function_ = nullptr;
  const void* context_ = nullptr;
  std::int64_t chunks_ = 0;
  alignas(64) std::atomic<std::int64_t> next_chunk_ = 0;
  // The loop's number times kLoop, plus kOpen while helpers may enter, plus the number of helpers inside.
  alignas(64) std::atomic<std::uint64_t> door_ = 0;
  // Sleeping helpers wait for this to change; every loop changes it.
  alignas(64) std::atomic<std::uint32_t> bell_ = 0;
  std::atomic<bool> ending_ = false;
};

// A team of only the calling thread; every thread has its own.
ThreadTeam& Alone();

}  // namespace planish
