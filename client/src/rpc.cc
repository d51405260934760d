#include "client/src/rpc.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <utility>

#include "client/src/backoff.h"
#include "client/src/connection.h"
#include "client/src/convert.h"
#include "client/src/errors.h"
#include "client/src/request_id.h"
#include "client/src/trace_scope.h"
#include "planish/admin/v1/admin.grpc.pb.h"
#include "planish/v1/planish.grpc.pb.h"

namespace planish {
inline namespace abi0 {
namespace {

using WallClock = std::chrono::system_clock;

// Answers that carry no mesh must not take longer than this, connection included.
constexpr double kUnarySeconds = 20;
// A call in the background keeps its Rpc alive for so long at most.
constexpr double kBackgroundSeconds = 5;
constexpr double kLongestRpcPauseSeconds = 2;

Error ErrorOfCall(const grpc::Status& status, const Connection& connection) {
  google::rpc::Status rich;
  if (!status.error_details().empty() && rich.ParseFromString(status.error_details()) && rich.details_size() > 0) {
    return ErrorFrom(rich);
  }
  rich.set_code(static_cast<int>(status.error_code()));
  rich.set_message(status.error_message());
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    return connection.WhyUnreachable(status.error_message());
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) rich.set_message("the time given to the call passed");
  return ErrorFrom(rich);
}

// What every call needs.
void Prepare(grpc::ClientContext& context, const Connection& connection, Deadline deadline) {
  if (deadline) context.set_deadline(*deadline);
  context.AddMetadata("traceparent", NextTraceparent());
  connection.Prepare(context);
}

template <typename Response>
class GrpcStream : public Stream {
 public:
  using Opener = std::function<std::unique_ptr<grpc::ClientReader<Response>>(grpc::ClientContext*)>;

  GrpcStream(Deadline deadline, std::shared_ptr<const Connection> connection, Opener opener)
      : connection_(std::move(connection)), opener_(std::move(opener)) {
    Prepare(context_, *connection_, deadline);
  }

  // The stream may be abandoned half-way, by an exception of a callback for instance.
  ~GrpcStream() override {
    if (reader_ == nullptr || finished_) return;
    context_.TryCancel();
    reader_->Finish();
  }

  void Start() override { reader_ = opener_(&context_); }

  bool Read(StreamItem& item) override {
    Response response;
    if (!reader_->Read(&response)) return false;
    item = {};
    if (response.has_event()) item.event = std::move(*response.mutable_event());
    if (response.has_uv()) item.uv = std::move(*response.mutable_uv());
    return true;
  }

  std::optional<Error> Finish() override {
    finished_ = true;
    const grpc::Status status = reader_->Finish();
    if (status.ok()) return std::nullopt;
    return ErrorOfCall(status, *connection_);
  }

  void TryCancel() override { context_.TryCancel(); }

 private:
  const std::shared_ptr<const Connection> connection_;
  const Opener opener_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<Response>> reader_;
  bool finished_ = false;
};

class GrpcUploadStream : public UploadStream {
 public:
  GrpcUploadStream(v1::Planish::Stub* stub, Deadline deadline, std::shared_ptr<const Connection> connection)
      : connection_(std::move(connection)) {
    Prepare(context_, *connection_, deadline);
    writer_ = stub->WriteUpload(&context_, &upload_);
  }

  ~GrpcUploadStream() override {
    if (finished_) return;
    context_.TryCancel();
    writer_->Finish();
  }

  bool Write(const v1::WriteUploadRequest& request) override { return writer_->Write(request); }

  v1::Upload Finish() override {
    writer_->WritesDone();
    finished_ = true;
    const grpc::Status status = writer_->Finish();
    if (!status.ok()) throw ErrorOfCall(status, *connection_);
    return std::move(upload_);
  }

  void TryCancel() override { context_.TryCancel(); }

 private:
  const std::shared_ptr<const Connection> connection_;
  grpc::ClientContext context_;
  v1::Upload upload_;
  std::unique_ptr<grpc::ClientWriter<v1::WriteUploadRequest>> writer_;
  bool finished_ = false;
};

template <typename Request>
Request NameRequest(const std::string& name) {
  Request request;
  request.set_name(name);
  return request;
}

}  // namespace

struct Rpc::Stubs {
  explicit Stubs(std::shared_ptr<const Connection> c)
      : connection(std::move(c)),
        channel(connection->NewChannel()),
        planish(v1::Planish::NewStub(channel)),
        admin(admin::v1::Admin::NewStub(channel)) {}

  // Runs one unary call and throws if it fails.
  template <typename Request, typename Response>
  Response Unary(Rpc& rpc, grpc::Status (v1::Planish::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                 const Request& request, Deadline deadline) {
    rpc.Connect(deadline);
    grpc::ClientContext context;
    Prepare(context, *connection, deadline);
    Response response;
    const grpc::Status status = (planish.get()->*method)(&context, request, &response);
    if (!status.ok()) throw ErrorOfCall(status, *connection);
    return response;
  }

  // The same for a call that may be repeated. `attempts`, if given, tells how often it was made.
  template <typename Request, typename Response>
  Response Repeated(Rpc& rpc,
                    grpc::Status (v1::Planish::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, int* attempts = nullptr) {
    const Deadline deadline = DeadlineAfter(kUnarySeconds);
    const WallClock::time_point start = WallClock::now();
    Backoff backoff(rpc.options_.reattach_backoff_seconds, kLongestRpcPauseSeconds, NewRequestId());
    while (true) {
      try {
        if (attempts != nullptr) ++*attempts;
        return Unary(rpc, method, request, deadline);
      } catch (const Error& error) {
        const std::chrono::duration<double> pause(std::max(backoff.Next(), error.retry_after_seconds()));
        const std::chrono::duration<double> limit(rpc.options_.retry_seconds);
        // A server that was never there is not coming back soon: say so at once.
        if (error.code() != ErrorCode::kUnavailable || !rpc.reached_ || WallClock::now() - start + pause > limit) throw;
        std::this_thread::sleep_for(pause);
      }
    }
  }

  // Runs one call of an operator's.
  template <typename Response, typename Request>
  Response Operate(Rpc& rpc,
                   grpc::Status (admin::v1::Admin::Stub::*method)(grpc::ClientContext*, const Request&, Response*)) {
    const Deadline deadline = DeadlineAfter(kUnarySeconds);
    rpc.Connect(deadline);
    grpc::ClientContext context;
    Prepare(context, *connection, deadline);
    Response response;
    const grpc::Status status = (admin.get()->*method)(&context, Request(), &response);
    if (!status.ok()) throw ErrorOfCall(status, *connection);
    return response;
  }

  const std::shared_ptr<const Connection> connection;
  const std::shared_ptr<grpc::Channel> channel;
  const std::unique_ptr<v1::Planish::Stub> planish;
  const std::unique_ptr<admin::v1::Admin::Stub> admin;
};

Deadline DeadlineAfter(double seconds) {
  if (seconds <= 0) return std::nullopt;
  return WallClock::now() + std::chrono::duration_cast<WallClock::duration>(std::chrono::duration<double>(seconds));
}

Rpc::Rpc(const std::string& target, const ClientOptions& options)
    : options_(options), stubs_(std::make_shared<Stubs>(std::make_shared<Connection>(target, options))) {}

const std::string& Rpc::target() const {
  return stubs_->connection->target();
}

Rpc::~Rpc() = default;

bool Rpc::Connect(Deadline deadline) {
  const auto patience = std::chrono::duration<double>(options_.connect_timeout_seconds);
  WallClock::time_point until = WallClock::now() + std::chrono::duration_cast<WallClock::duration>(patience);
  if (deadline) until = std::min(until, *deadline);
  grpc::Channel& channel = *stubs_->channel;
  auto state = channel.GetState(true);
  for (; state == GRPC_CHANNEL_IDLE || state == GRPC_CHANNEL_CONNECTING; state = channel.GetState(true)) {
    if (channel.WaitForStateChange(state, until)) continue;
    throw stubs_->connection->WhyUnreachable("no connection in time");
  }
  if (state == GRPC_CHANNEL_READY) reached_ = true;
  return state == GRPC_CHANNEL_READY;
}

std::unique_ptr<Stream> Rpc::Unwrap(const v1::UnwrapRequest& request, Deadline deadline) {
  return std::make_unique<GrpcStream<v1::UnwrapResponse>>(
      deadline, stubs_->connection,
      [this, &request](grpc::ClientContext* context) { return stubs_->planish->Unwrap(context, request); });
}

std::unique_ptr<Stream> Rpc::WatchJob(const v1::WatchJobRequest& request, Deadline deadline) {
  return std::make_unique<GrpcStream<v1::WatchJobResponse>>(
      deadline, stubs_->connection,
      [this, &request](grpc::ClientContext* context) { return stubs_->planish->WatchJob(context, request); });
}

v1::Job Rpc::CreateJob(const v1::CreateJobRequest& request, Deadline deadline) {
  return stubs_->Unary(*this, &v1::Planish::Stub::CreateJob, request, deadline);
}

v1::BatchCreateJobsResponse Rpc::BatchCreateJobs(const v1::BatchCreateJobsRequest& request) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::BatchCreateJobs, request);
}

v1::FindMissingMeshesResponse Rpc::FindMissingMeshes(const v1::FindMissingMeshesRequest& request) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::FindMissingMeshes, request);
}

v1::Job Rpc::GetJob(const std::string& name) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::GetJob, NameRequest<v1::GetJobRequest>(name));
}

v1::Job Rpc::WaitJob(const std::string& name, double seconds) {
  auto request = NameRequest<v1::WaitJobRequest>(name);
  SetSeconds(seconds, request.mutable_timeout());
  return stubs_->Repeated(*this, &v1::Planish::Stub::WaitJob, request);
}

v1::ReadResultResponse Rpc::ReadResult(const std::string& name, std::int64_t offset, std::int64_t limit) {
  auto request = NameRequest<v1::ReadResultRequest>(name);
  request.set_offset(offset);
  request.set_limit(limit);
  return stubs_->Repeated(*this, &v1::Planish::Stub::ReadResult, request);
}

v1::ListJobsResponse Rpc::ListJobs(const v1::ListJobsRequest& request) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::ListJobs, request);
}

v1::Job Rpc::StopJob(const std::string& name) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::StopJob, NameRequest<v1::StopJobRequest>(name));
}

v1::Job Rpc::CancelJob(const std::string& name) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::CancelJob, NameRequest<v1::CancelJobRequest>(name));
}

void Rpc::DeleteJob(const std::string& name) {
  int attempts = 0;
  try {
    stubs_->Repeated(*this, &v1::Planish::Stub::DeleteJob, NameRequest<v1::DeleteJobRequest>(name), &attempts);
  } catch (const Error& error) {
    // An attempt before this one got through, and only its answer was lost.
    if (attempts == 1 || error.code() != ErrorCode::kNotFound) throw;
  }
}

v1::JobEstimate Rpc::EstimateJob(const v1::EstimateJobRequest& request) {
  return stubs_->Repeated(*this, &v1::Planish::Stub::EstimateJob, request);
}

v1::Capabilities Rpc::GetCapabilities() {
  return stubs_->Repeated(*this, &v1::Planish::Stub::GetCapabilities, v1::GetCapabilitiesRequest());
}

v1::Upload Rpc::CreateUpload(const v1::CreateUploadRequest& request) {
  return stubs_->Unary(*this, &v1::Planish::Stub::CreateUpload, request, DeadlineAfter(kUnarySeconds));
}

v1::Upload Rpc::GetUpload(const std::string& name) {
  return stubs_->Unary(*this, &v1::Planish::Stub::GetUpload, NameRequest<v1::GetUploadRequest>(name),
                       DeadlineAfter(kUnarySeconds));
}

std::unique_ptr<UploadStream> Rpc::WriteUpload(Deadline deadline) {
  Connect(deadline);
  return std::make_unique<GrpcUploadStream>(stubs_->planish.get(), deadline, stubs_->connection);
}

void Rpc::Drain() {
  stubs_->Operate(*this, &admin::v1::Admin::Stub::Drain);
}

void Rpc::Undrain() {
  stubs_->Operate(*this, &admin::v1::Admin::Stub::Undrain);
}

admin::v1::Stats Rpc::GetStats() {
  return stubs_->Operate(*this, &admin::v1::Admin::Stub::GetStats);
}

admin::v1::Config Rpc::GetConfig() {
  return stubs_->Operate(*this, &admin::v1::Admin::Stub::GetConfig);
}

void Rpc::StopJobInBackground(const std::string& name) {
  InBackground([name](v1::Planish::Stub& planish, grpc::ClientContext* context) {
    v1::Job job;
    planish.StopJob(context, NameRequest<v1::StopJobRequest>(name), &job);
  });
}

void Rpc::CancelJobInBackground(const std::string& name) {
  InBackground([name](v1::Planish::Stub& planish, grpc::ClientContext* context) {
    v1::Job job;
    planish.CancelJob(context, NameRequest<v1::CancelJobRequest>(name), &job);
  });
}

// Not by gRPC's callbacks: the last reference to the channel must not go on one of the channel's own threads, which
// would have to wait for themselves. Whether the call got through shows in the job's own stream.
template <typename Call>
void Rpc::InBackground(Call call) {
  const std::lock_guard lock(background_mutex_);
  background_.emplace_back([stubs = stubs_, call = std::move(call), traceparent = NextTraceparent()] {
    const TraceScope scope(traceparent);
    grpc::ClientContext context;
    try {
      Prepare(context, *stubs->connection, DeadlineAfter(kBackgroundSeconds));
    } catch (const Error&) {
      return;  // no token any more: the call would be refused
    }
    call(*stubs->planish, &context);
  });
}

}  // namespace abi0
}  // namespace planish
