// Workers that do what a test tells them, step by step.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>

#include "server/link/worker_link.h"

namespace planish {

// Does one job, a WorkRequest with its blobs, on the worker's thread. False: the worker ends, as if it had died.
using WorkerScript = std::function<bool(ServerLink& server, const ServerLink::Received& job)>;

// Workers that say they are idle, run `script` for each job, and say so again.
WorkerFactory ScriptedWorkers(WorkerScript script);

// Messages to the server. SuccessMessage() goes with `uv_bytes` as a blob.
worker::v1::FromWorker IdleMessage();
worker::v1::FromWorker ProgressMessage(int newton_iteration);
worker::v1::FromWorker SuccessMessage(const std::string& uv_bytes);
worker::v1::FromWorker FailureMessage(const absl::Status& status);
worker::v1::FromWorker CancelledMessage();

// SuccessMessage() with its blob.
void SendSuccess(ServerLink& server, const std::string& uv_bytes);

// Reports `iterations` Newton iterations, then `uv_bytes`.
WorkerScript Succeed(int iterations, const std::string& uv_bytes);

// Reports iteration 1, then waits for a cancellation and obeys; a link that closes ends it without a result.
WorkerScript WaitForCancel();

// A door that threads wait at until a test opens it. Thread-safe.
class Gate {
 public:
  void Open();
  void Wait();

 private:
  std::mutex mutex_;
  std::condition_variable opened_;
  bool open_ = false;
};

}  // namespace planish
