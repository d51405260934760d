// The two ends of the line between the server and one worker. Only messages of planish.worker.v1 pass, so that a
// worker may be a thread, a process or a machine. One link serves one job.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "planish/worker/v1/worker.pb.h"

namespace planish {

// The server's end. The destructor closes the link and gives back whatever the worker held.
class WorkerLink {
 public:
  virtual ~WorkerLink() = default;

  // Hands a message over without waiting for the worker to read it; dropped once the link is closed. Thread-safe.
  virtual void Send(worker::v1::ToWorker message) = 0;

  // Waits for the worker's next message. Empty when the link is closed, by the worker's death or by Close(), and
  // all that came before was received. One thread at a time.
  virtual std::optional<worker::v1::FromWorker> Receive() = 0;

  // Gives the worker up. Thread-safe.
  virtual void Close() = 0;
};

// The worker's end.
class ServerLink {
 public:
  virtual ~ServerLink() = default;

  // Hands a message over without waiting for the server to read it; dropped once the link is closed. Thread-safe.
  virtual void Send(worker::v1::FromWorker message) = 0;

  // Waits for the server's next message. Empty when the link is closed: nobody waits for a result any more.
  // One thread at a time.
  virtual std::optional<worker::v1::ToWorker> Receive() = 0;

  // Hangs up: a Receive() under way returns. Thread-safe.
  virtual void Close() = 0;
};

// Starts a worker for one job. Called from any thread. An error fails the job, not the server.
using WorkerFactory = std::function<absl::StatusOr<std::shared_ptr<WorkerLink>>()>;

}  // namespace planish
