// The connection: stubs, deadlines and status translation. rpc.cc is the only file with generated gRPC code.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "planish/client.h"
#include "planish/v1/planish.pb.h"

namespace planish {
inline namespace api {

// When a call must be over; nothing: never.
using Deadline = std::optional<std::chrono::system_clock::time_point>;
Deadline DeadlineAfter(double seconds);  // 0: never

// One item of Unwrap's or WatchJob's stream: exactly one is set.
struct StreamItem {
  std::optional<v1::JobEvent> event;
  std::optional<v1::UvChunk> uv;
};

// A server stream. TryCancel may come from any thread at any time, the others belong to one.
class Stream {
 public:
  virtual ~Stream() = default;
  // First of all: sends the request, which may take long. The request must live until then.
  virtual void Start() = 0;
  // False at the end of the stream.
  virtual bool Read(StreamItem& item) = 0;
  // Why the stream ended, after Read returned false: nothing if all is well.
  virtual std::optional<Error> Finish() = 0;
  virtual void TryCancel() = 0;
};

// Thread-safe. Calls throw planish::Error.
class Rpc {
 public:
  Rpc(const std::string& target, const ClientOptions& options);
  ~Rpc();
  const std::string& target() const { return target_; }

  // Whether a connection stands, waiting for it until it fails, or connect_timeout_seconds or `deadline` pass. The
  // next call says why it failed; a peer that stays silent throws SERVER_UNREACHABLE.
  bool Connect(Deadline deadline);

  std::unique_ptr<Stream> Unwrap(const v1::UnwrapRequest& request, Deadline deadline);
  std::unique_ptr<Stream> WatchJob(const v1::WatchJobRequest& request, Deadline deadline);

  v1::Job CreateJob(const v1::CreateJobRequest& request, Deadline deadline);
  v1::Job GetJob(const std::string& name);
  v1::ListJobsResponse ListJobs(const v1::ListJobsRequest& request);
  v1::Job CancelJob(const std::string& name);
  void DeleteJob(const std::string& name);
  v1::Capabilities GetCapabilities();

  // Returns at once. The answer is not waited for: whoever cancels watches the job's stream. The destructor waits for
  // calls that are still out, a few seconds at most.
  void CancelJobInBackground(const std::string& name);

 private:
  struct Stubs;
  std::string target_;
  ClientOptions options_;
  std::shared_ptr<Stubs> stubs_;
  std::mutex cancels_mutex_;
  std::vector<std::jthread> cancels_;  // guarded by cancels_mutex_; joined by their destructors
};

}  // namespace api
}  // namespace planish
