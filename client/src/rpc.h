// The connection: stubs, deadlines and status translation. rpc.cc is the only file with generated gRPC code.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "planish/admin/v1/admin.pb.h"
#include "planish/client.h"
#include "planish/v1/planish.pb.h"

namespace planish {
inline namespace abi0 {

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

// The stream of a WriteUpload. TryCancel may come from any thread at any time, the others belong to one.
class UploadStream {
 public:
  virtual ~UploadStream() = default;
  // False if the stream broke: Finish() says why.
  virtual bool Write(const v1::WriteUploadRequest& request) = 0;
  // Ends the stream; the upload as the server has it then. Throws why it broke, or was refused.
  virtual v1::Upload Finish() = 0;
  virtual void TryCancel() = 0;
};

// Thread-safe. Calls belong to the trace of their thread (trace_scope.h) and throw planish::Error. Those that may be
// repeated safely are, for retry_seconds at most, while a server that was reached before is UNAVAILABLE.
class Rpc {
 public:
  // Throws as Client::Client does.
  Rpc(const std::string& target, const ClientOptions& options);
  ~Rpc();
  const std::string& target() const;

  // Whether a connection stands, waiting for it until it fails, or connect_timeout_seconds or `deadline` pass. The
  // next call says why it failed; a peer that stays silent throws SERVER_UNREACHABLE or TLS_FAILED.
  bool Connect(Deadline deadline);

  // Whether there was a connection, ever.
  bool reached() const { return reached_; }

  std::unique_ptr<Stream> Unwrap(const v1::UnwrapRequest& request, Deadline deadline);
  std::unique_ptr<Stream> WatchJob(const v1::WatchJobRequest& request, Deadline deadline);

  // Once, whatever happens: the caller sees to it that the mesh is there.
  v1::Job CreateJob(const v1::CreateJobRequest& request, Deadline deadline);

  // The request ids of `request` make repeating safe. For any server: uploads are named in none of its specs.
  v1::BatchCreateJobsResponse BatchCreateJobs(const v1::BatchCreateJobsRequest& request);
  v1::FindMissingMeshesResponse FindMissingMeshes(const v1::FindMissingMeshesRequest& request);

  v1::Job GetJob(const std::string& name);
  // Answers after so many seconds at the latest, which must be fewer than a unary call may take.
  v1::Job WaitJob(const std::string& name, double seconds);
  // At most so many bytes, from `offset` on.
  v1::ReadResultResponse ReadResult(const std::string& name, std::int64_t offset, std::int64_t limit);
  v1::ListJobsResponse ListJobs(const v1::ListJobsRequest& request);
  v1::Job StopJob(const std::string& name);
  v1::Job CancelJob(const std::string& name);
  void DeleteJob(const std::string& name);
  v1::JobEstimate EstimateJob(const v1::EstimateJobRequest& request);
  v1::Capabilities GetCapabilities();

  // Once each.
  v1::Upload CreateUpload(const v1::CreateUploadRequest& request);
  v1::Upload GetUpload(const std::string& name);
  std::unique_ptr<UploadStream> WriteUpload(Deadline deadline);

  // planish.admin.v1.Admin. Once each.
  void Drain();
  void Undrain();
  admin::v1::Stats GetStats();
  admin::v1::Config GetConfig();

  // Return at once. The answer is not waited for: whoever stops or cancels watches the job's stream. The destructor
  // waits for calls that are still out, a few seconds at most.
  void StopJobInBackground(const std::string& name);
  void CancelJobInBackground(const std::string& name);

 private:
  struct Stubs;
  template <typename Call>
  void InBackground(Call call);

  ClientOptions options_;
  std::shared_ptr<Stubs> stubs_;
  std::atomic<bool> reached_ = false;
  std::mutex background_mutex_;
  std::vector<std::jthread> background_;  // guarded by background_mutex_; joined by their destructors
};

}  // namespace abi0
}  // namespace planish
