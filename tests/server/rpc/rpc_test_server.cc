#include "tests/server/rpc/rpc_test_server.h"

#include <condition_variable>
#include <mutex>
#include <utility>

#include "grpc/grpc.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "server/rpc/service.h"

namespace planish {
namespace {

template <class Response>
Received ReceiveStream(grpc::ClientReader<Response>* reader) {
  Received received;
  Response response;
  while (reader->Read(&response)) {
    if (response.has_event()) received.events.push_back(response.event());
    if (response.has_uv()) {
      received.chunks.push_back(response.uv());
      received.uv += response.uv().data();
    }
  }
  received.status = reader->Finish();
  return received;
}

std::string ToString(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  if (!buffer.Dump(&slices).ok()) return "";
  std::string bytes;
  for (const grpc::Slice& slice : slices) bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return bytes;
}

WorkerPoolOptions Workers(int count) {
  WorkerPoolOptions options;
  options.workers = count;
  return options;
}

JobManagerOptions WithUploads(JobManagerOptions options, UploadStore* uploads) {
  options.is_blob_used = [uploads](const BlobId& id) { return uploads->Uses(id); };
  return options;
}

// Shared with the subscription: a wake-up may come after the reader has left.
struct Bell {
  std::mutex mutex;
  std::condition_variable rung;
  bool ring = false;
};

class Reader {
 public:
  explicit Reader(const JobEventLog& log)
      : log_(log), subscription_(log.Subscribe([bell = bell_] {
          const std::lock_guard lock(bell->mutex);
          bell->ring = true;
          bell->rung.notify_one();
        })) {}

  // The event after `after`; empty at the end.
  std::optional<v1::JobEvent> WaitAfter(std::int64_t after) {
    while (true) {
      JobEventLog::Read read = log_.ReadAfter(after);
      if (read.event.has_value() || read.ended) return read.event;
      std::unique_lock lock(bell_->mutex);
      bell_->rung.wait(lock, [this] { return bell_->ring; });
      bell_->ring = false;
    }
  }

 private:
  const JobEventLog& log_;
  const std::shared_ptr<Bell> bell_ = std::make_shared<Bell>();
  const JobEventLog::Subscription subscription_;
};

}  // namespace

RpcTestServer::RpcTestServer(WorkerScript script, JobManagerOptions options, UploadStoreOptions upload_options,
                             double progress_per_second, std::unique_ptr<CallerSource> callers)
    : uploads_(std::move(upload_options), &blobs_),
      store_(std::make_unique<JobStore>(std::make_unique<FailingDatabase>(*OpenSqliteDatabase(":memory:"), &fault_))),
      manager_(*JobManager::Open(WithUploads(options, &uploads_), store_.get(), &blobs_)),
      pool_(std::make_unique<WorkerPool>(manager_->source(), ScriptedWorkers(std::move(script)),
                                         Workers(options.workers))),
      callers_(std::move(callers)) {
  // Never taken back: the last grpc_shutdown() joins gRPC's own threads, one of which may sit in a poll for 10 s.
  static const bool kept = (grpc_init(), true);
  static_cast<void>(kept);
  ServiceOptions service_options;
  service_options.capabilities.set_version("1.2.3");
  service_options.capabilities.set_workers(options.workers);
  service_options.capabilities.set_upload_chunk_bytes(64 << 10);
  service_options.failpoints = true;
  service_options.update_capabilities = [this](const Caller& caller, v1::Capabilities* capabilities) {
    capabilities->set_queue_capacity(manager_->QueueCapacity(caller));
  };
  service_options.progress_per_second = progress_per_second;
  service_ = NewPlanishService(manager_.get(), &uploads_, std::move(service_options), &streams_);
  RpcServerOptions rpc_options;
  rpc_options.listen.push_back(*ParseListenAddress("unix:" + dir_.Path("socket")));
  rpc_options.callers = callers_.get();
  rpc_options.max_mesh_bytes = options.max_mesh_bytes;
  rpc_options.upload_chunk_bytes = 64 << 10;
  rpc_ = *RpcServer::Start(rpc_options, {service_.get()});
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  channel_ = grpc::CreateCustomChannel("unix:" + dir_.Path("socket"), grpc::InsecureChannelCredentials(), arguments);
  stub_ = v1::Planish::NewStub(channel_);
  ticks_ = std::jthread([this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      manager_->Tick();
      uploads_.Tick(absl::Now());
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
}

RpcTestServer::~RpcTestServer() {
  manager_->Drain([] {});
  manager_->CancelAll();
  streams_.WaitForNone(absl::Now() + absl::Seconds(5));
  rpc_->Shutdown(absl::Now());
  manager_->StopWorkers();
  // Work that was being claimed when it was cancelled hears of that by a tick.
  pool_ = nullptr;
  ticks_ = std::jthread();
}

std::string RpcTestServer::Create() {
  grpc::ClientContext context;
  v1::CreateJobRequest request;
  request.mutable_spec()->set_draco("mesh");
  v1::Job job;
  const grpc::Status status = stub_->CreateJob(&context, request, &job);
  return status.ok() ? job.name() : status.error_message();
}

std::string RpcTestServer::CallBytes(const std::string& method, const std::string& request) {
  grpc::GenericStub stub(channel_);
  grpc::CompletionQueue queue;
  grpc::ClientContext context;
  const auto wait = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  const grpc::Slice slice(request);
  grpc::ByteBuffer answer;
  grpc::Status status;
  const auto call = stub.PrepareCall(&context, method, &queue);
  call->StartCall(nullptr);
  wait();
  call->Write(grpc::ByteBuffer(&slice, 1), nullptr);
  wait();
  call->WritesDone(nullptr);
  wait();
  call->Read(&answer, nullptr);
  const bool answered = wait();
  context.TryCancel();
  call->Finish(&status, nullptr);
  wait();
  return answered ? ToString(answer) : status.error_message();
}

Received ReceiveAll(grpc::ClientReader<v1::UnwrapResponse>* reader) {
  return ReceiveStream(reader);
}
Received ReceiveAll(grpc::ClientReader<v1::WatchJobResponse>* reader) {
  return ReceiveStream(reader);
}

google::rpc::ErrorInfo InfoOf(const grpc::Status& status) {
  google::rpc::Status rpc;
  google::rpc::ErrorInfo info;
  if (!rpc.ParseFromString(status.error_details()) || rpc.code() != status.error_code()) return info;
  for (const auto& detail : rpc.details()) {
    if (detail.UnpackTo(&info) && info.domain() == "planish") return info;
  }
  return google::rpc::ErrorInfo();
}

std::string ViolationOf(const grpc::Status& status) {
  google::rpc::Status rpc;
  google::rpc::BadRequest bad;
  if (!rpc.ParseFromString(status.error_details())) return "";
  for (const auto& detail : rpc.details()) {
    if (detail.UnpackTo(&bad) && bad.field_violations_size() == 1) return bad.field_violations(0).field();
  }
  return "";
}

bool HasRetryInfo(const grpc::Status& status) {
  google::rpc::Status rpc;
  google::rpc::RetryInfo retry;
  if (!rpc.ParseFromString(status.error_details())) return false;
  for (const auto& detail : rpc.details()) {
    if (detail.UnpackTo(&retry)) return true;
  }
  return false;
}

std::vector<v1::JobEvent> Follow(const JobEventLog& log) {
  Reader reader(log);
  std::vector<v1::JobEvent> events;
  while (auto event = reader.WaitAfter(events.empty() ? 0 : events.back().sequence())) events.push_back(*event);
  return events;
}

void WaitForEvent(const JobEventLog& log, std::int64_t sequence) {
  Reader(log).WaitAfter(sequence - 1);
}

}  // namespace planish
