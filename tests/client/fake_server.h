// A planish server for tests that does what the test says, on a real socket.
#pragma once

#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "google/rpc/status.pb.h"
#include "planish/error.h"
#include "planish/v1/planish.pb.h"

namespace planish::testing {

// The server's side of an open Unwrap or WatchJob.
class FakeStream {
 public:
  virtual ~FakeStream() = default;
  virtual void Send(const v1::JobEvent& event) = 0;
  virtual void SendUv(std::int64_t offset, const std::string& data) = 0;
  virtual bool IsCancelled() const = 0;
};

// The server's side of an open WriteUpload.
class FakeUpload {
 public:
  virtual ~FakeUpload() = default;
  // False when the client has sent all or is gone.
  virtual bool Next(v1::WriteUploadRequest& request) = 0;
};

class FakeServer {
 public:
  using Status = google::rpc::Status;

  // On a free port, or the one of a server that is gone.
  explicit FakeServer(int port = 0);
  ~FakeServer();
  // Ends all calls and waits for the functions below to return: one may still run, or only begin, when the client's
  // call is over. For tests in which that may happen and what the functions use goes away before the server.
  void Stop();
  const std::string& target() const { return target_; }
  int port() const;

  // What calls do; set before they come. Left empty, they answer UNIMPLEMENTED.
  std::function<Status(const v1::UnwrapRequest&, FakeStream&)> on_unwrap;
  std::function<Status(const v1::WatchJobRequest&, FakeStream&)> on_watch;
  std::function<Status(const v1::ListJobsRequest&, v1::ListJobsResponse&)> on_list;
  std::function<Status(const std::string& method, const std::string& job, v1::Job&)>
      on_job;  // Get, Stop, Cancel, Delete
  std::function<Status(const v1::BatchCreateJobsRequest&, v1::BatchCreateJobsResponse&)> on_batch;
  std::function<Status(const v1::FindMissingMeshesRequest&, v1::FindMissingMeshesResponse&)> on_find_missing;
  std::function<Status(const v1::WaitJobRequest&, v1::Job&)> on_wait;
  std::function<Status(const v1::ReadResultRequest&, v1::ReadResultResponse&)> on_read;
  std::function<Status(const v1::CreateJobRequest&, v1::Job&)> on_create;
  std::function<Status(const v1::EstimateJobRequest&, v1::JobEstimate&)> on_estimate;
  std::function<Status(v1::Capabilities&)> on_capabilities;
  std::function<Status(const v1::CreateUploadRequest&, v1::Upload&)> on_create_upload;
  std::function<Status(const std::string& name, v1::Upload&)> on_get_upload;
  std::function<Status(FakeUpload&, v1::Upload&)> on_write_upload;

 private:
  class Service;
  std::unique_ptr<Service> service_;
  std::string target_;
};

// {code, message} with an ErrorInfo if `reason` is not empty, and a RetryInfo if `retry_seconds` is not 0.
google::rpc::Status MakeStatus(int code, const std::string& message, const std::string& reason = "",
                               const std::map<std::string, std::string>& metadata = {}, double retry_seconds = 0);

// Events of "jobs/1".
v1::JobEvent StateEvent(std::int64_t sequence, v1::JobState state);
v1::JobEvent ProgressEvent(std::int64_t sequence, int newton_iteration, double residual);
// The last event of a job that succeeded on the mesh with `draco`.
v1::JobEvent SuccessEvent(std::int64_t sequence, const std::string& draco, const std::string& uv_bytes,
                          v1::Precision precision = v1::PRECISION_FLOAT);

// A square of two triangles, and its UV by corners.
inline const std::vector<float> kPositions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
inline const std::vector<std::uint32_t> kTriangles = {0, 1, 2, 0, 2, 3};
inline const std::vector<float> kUv = {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1};

// The error that `call` throws; one that it throws is expected.
Error ErrorOf(const std::function<void()>& call);

// Numbers as they travel.
template <typename Number>
std::string Bytes(const std::vector<Number>& numbers) {
  return std::string(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(Number));
}

// What planish.v1.MeshElements packs.
template <typename Number>
std::vector<Number> NumbersIn(const std::string& bytes) {
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  if (!bytes.empty()) std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

}  // namespace planish::testing
