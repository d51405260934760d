#include "client/cli/batch_queue.h"

#include <cstddef>
#include <utility>

namespace planish::cli {

Job BatchQueue::Create(const NewJob& job) {
  Waiting mine;
  mine.job = &job;
  std::unique_lock lock(mutex_);
  waiting_.push_back(&mine);
  while (!mine.done) {
    if (busy_) {
      changed_.wait(lock);
      continue;
    }
    busy_ = true;
    const std::vector<Waiting*> together = std::exchange(waiting_, {});
    lock.unlock();
    CreateTogether(together);
    lock.lock();
    for (Waiting* each : together) each->done = true;
    busy_ = false;
    changed_.notify_all();
  }
  if (mine.failure) std::rethrow_exception(mine.failure);
  return std::move(*mine.created).value();
}

void BatchQueue::CreateTogether(const std::vector<Waiting*>& together) {
  try {
    std::vector<NewJob> jobs;
    for (const Waiting* each : together) jobs.push_back(*each->job);
    std::vector<Result<Job>> created = client_->CreateJobs(jobs);
    for (std::size_t i = 0; i < together.size(); ++i) together[i]->created = std::move(created[i]);
  } catch (...) {
    for (Waiting* each : together) each->failure = std::current_exception();
  }
}

}  // namespace planish::cli
