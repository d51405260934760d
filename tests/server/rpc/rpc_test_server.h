// A server with scripted workers on a Unix socket, and a client for it.
#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "planish/v1/planish.grpc.pb.h"
#include "server/blobs/blob_catalog.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/upload_store.h"
#include "server/jobs/worker_pool.h"
#include "server/rpc/caller_source.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/stream_counter.h"
#include "tests/server/store/failing_database.h"
#include "tests/testing/fake_workers.h"
#include "tests/testing/files.h"

namespace planish {

// Who makes all calls where an RpcTestServer is not told otherwise.
inline const Caller kEverybody = {kDefaultTenant, "", Rights::All(), ""};

// Answers of grpc.health.v1.Health, as bytes.
inline const std::string kServing("\x08\x01");
inline const std::string kNotServing("\x08\x02");

class RpcTestServer {
 public:
  explicit RpcTestServer(WorkerScript script, JobManagerOptions options = JobManagerOptions(),
                         UploadStoreOptions upload_options = UploadStoreOptions(), double progress_per_second = 1e9,
                         std::unique_ptr<CallerSource> callers = NewOpenCallerSource());
  ~RpcTestServer();

  JobManager& manager() { return *manager_; }
  RpcServer& rpc() { return *rpc_; }
  UploadStore& uploads() { return uploads_; }
  StreamCounter& streams() { return streams_; }
  Fault& fault() { return fault_; }  // of the database
  v1::Planish::Stub& stub() { return *stub_; }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }

  // CreateJob with a small mesh; the job's name.
  std::string Create();

  // Sends `request` to `method` ("/package.Service/Method") and returns the first answer, or the error's message.
  std::string CallBytes(const std::string& method, const std::string& request);

 private:
  TempDir dir_;
  BlobCatalog blobs_{{}, std::int64_t{1} << 30};
  UploadStore uploads_;
  Fault fault_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<JobManager> manager_;
  std::unique_ptr<WorkerPool> pool_;
  StreamCounter streams_;
  const std::unique_ptr<CallerSource> callers_;
  std::unique_ptr<RpcService> service_;
  std::unique_ptr<RpcServer> rpc_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Planish::Stub> stub_;
  std::jthread ticks_;  // does what is due, again and again
};

// What came over a stream until it ended.
struct Received {
  std::vector<v1::JobEvent> events;
  std::vector<v1::UvChunk> chunks;
  std::string uv;
  grpc::Status status;

  v1::Job LastJob() const { return events.empty() ? v1::Job() : events.back().job(); }
};

Received ReceiveAll(grpc::ClientReader<v1::UnwrapResponse>* reader);
Received ReceiveAll(grpc::ClientReader<v1::WatchJobResponse>* reader);

// The details of an error: reason "" if there is no ErrorInfo of domain "planish".
google::rpc::ErrorInfo InfoOf(const grpc::Status& status);
// The field that an INVALID_ARGUMENT's google.rpc.BadRequest names; empty if there is none.
std::string ViolationOf(const grpc::Status& status);
bool HasRetryInfo(const grpc::Status& status);

// Waits until the job ends; all its events.
std::vector<v1::JobEvent> Follow(const JobEventLog& log);

// Waits for the event with `sequence`, or a later one, or the end.
void WaitForEvent(const JobEventLog& log, std::int64_t sequence);

}  // namespace planish
