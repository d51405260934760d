// Queues the jobs of a batch that its threads have ready at the same time.
#pragma once

#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <vector>

#include "planish/client.h"

namespace planish::cli {

// Whoever comes while a call is under way waits, and is part of the next one. Thread-safe.
class BatchQueue {
 public:
  // `client` outlives the queue.
  explicit BatchQueue(Client* client) : client_(client) {}

  // As Client::CreateJob, but does not wait for room in the server's queue.
  Job Create(const NewJob& job);

 private:
  struct Waiting {
    const NewJob* job = nullptr;
    bool done = false;
    std::optional<Result<Job>> created;
    std::exception_ptr failure;  // of the whole call
  };

  // Without the lock.
  void CreateTogether(const std::vector<Waiting*>& together);

  Client* const client_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::vector<Waiting*> waiting_;
  bool busy_ = false;
};

}  // namespace planish::cli
