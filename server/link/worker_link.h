// The two ends of the link between the server and one worker. Only messages of planish.worker.v1 and blobs cross it, so
// a worker may be a thread or a process. One link serves any number of jobs, one after the other.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planish/worker/v1/worker.pb.h"
#include "server/link/blob.h"

namespace planish {

// How a job lost its worker.
struct WorkerLoss {
  std::string reason;                           // WORKER_CRASHED, WORKER_HUNG, OUT_OF_MEMORY or INTERNAL (Job.error)
  std::string message;                          // for people: "the worker was killed by signal 11 (SIGSEGV)"
  std::map<std::string, std::string> metadata;  // e.g. {"signal", "SIGSEGV"}
};

// The server's end. The destructor closes the link and releases everything that the worker held.
class WorkerLink {
 public:
  struct Received {
    worker::v1::FromWorker message;
    BlobPtr blob;  // may be null
  };

  enum class Wait {
    kMessage,  // `received` was filled
    kTimeout,
    kClosed,  // by the worker's death or by Close(), after all earlier messages were received
  };

  virtual ~WorkerLink() = default;

  // Sends a message without waiting for the worker. Dropped if the link is closed. Thread-safe.
  virtual void Send(worker::v1::ToWorker message, std::vector<BlobPtr> blobs) = 0;
  void Send(worker::v1::ToWorker message) { Send(std::move(message), {}); }

  // Waits for the worker's next message until `deadline`. One thread at a time.
  virtual Wait Receive(absl::Time deadline, Received* received) = 0;

  // Closes the link; a worker process is killed. Thread-safe.
  virtual void Close() = 0;

  // How the worker ended, after Receive() said kClosed. Waits for the end of a process that closed its link.
  virtual WorkerLoss HowEnded() = 0;
};

// The worker's end.
class ServerLink {
 public:
  struct Received {
    worker::v1::ToWorker message;
    std::vector<BlobPtr> blobs;
  };

  virtual ~ServerLink() = default;

  // Sends a message without waiting for the server. Dropped if the link is closed. Thread-safe.
  virtual void Send(worker::v1::FromWorker message, BlobPtr blob) = 0;
  void Send(worker::v1::FromWorker message) { Send(std::move(message), nullptr); }

  // Waits for the server's next message. Empty when the link is closed; then nobody waits for a result any more. One
  // thread at a time.
  virtual std::optional<Received> Receive() = 0;

  // Closes the link: a running Receive() returns. Thread-safe.
  virtual void Close() = 0;
};

// Starts a worker. Called from any thread.
using WorkerFactory = std::function<absl::StatusOr<std::shared_ptr<WorkerLink>>()>;

}  // namespace planish
