#include "client/src/rpc.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <utility>

#include "client/src/errors.h"
#include "planish/v1/planish.grpc.pb.h"

namespace planish {
inline namespace api {
namespace {

using Clock = std::chrono::system_clock;

// Answers that carry no mesh must not take longer than this, connection included.
constexpr double kUnarySeconds = 20;
// A cancellation in the background keeps its Rpc alive for so long at most.
constexpr double kCancelSeconds = 5;

std::shared_ptr<grpc::Channel> NewChannel(const std::string& target, const ClientOptions& options) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetMaxSendMessageSize(-1);
  // gRPC's own pace (20 s an attempt, 1 s and more between them) is for servers that talk to servers.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, static_cast<int>(1000 * options.connect_timeout_seconds));
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // A peer that vanished without a word is noticed within half a minute.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  // Clients to different servers, or to one server started anew, must not share connections and their back-off.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetUserAgentPrefix(std::string("planish/") + Version());
  return grpc::CreateCustomChannel(target, grpc::InsecureChannelCredentials(), arguments);
}

// gRPC wraps the cause in "failed to connect to all addresses; last error: UNKNOWN: ...: Connection refused".
std::string ConnectionCause(const std::string& message) {
  const std::size_t colon = message.rfind(": ");
  return colon == std::string::npos ? message : message.substr(colon + 2);
}

Error ErrorOfCall(const grpc::Status& status, const std::string& target) {
  google::rpc::Status rich;
  if (!status.error_details().empty() && rich.ParseFromString(status.error_details()) && rich.details_size() > 0) {
    return ErrorFrom(rich);
  }
  rich.set_code(static_cast<int>(status.error_code()));
  rich.set_message(status.error_message());
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    return Error(ErrorCode::kUnavailable, "SERVER_UNREACHABLE",
                 "cannot reach the planish server at " + target + ": " + ConnectionCause(status.error_message()));
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) rich.set_message("the time given to the call passed");
  return ErrorFrom(rich);
}

void SetDeadline(grpc::ClientContext& context, Deadline deadline) {
  if (deadline) context.set_deadline(*deadline);
}

template <typename Response>
class GrpcStream : public Stream {
 public:
  using Opener = std::function<std::unique_ptr<grpc::ClientReader<Response>>(grpc::ClientContext*)>;

  GrpcStream(Deadline deadline, std::string target, Opener opener)
      : target_(std::move(target)), opener_(std::move(opener)) {
    SetDeadline(context_, deadline);
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
    return ErrorOfCall(status, target_);
  }

  void TryCancel() override { context_.TryCancel(); }

 private:
  const std::string target_;
  const Opener opener_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<Response>> reader_;
  bool finished_ = false;
};

}  // namespace

struct Rpc::Stubs {
  explicit Stubs(std::shared_ptr<grpc::Channel> c) : channel(std::move(c)), planish(v1::Planish::NewStub(channel)) {}

  // Runs one unary call and throws if it fails.
  template <typename Request, typename Response>
  Response Unary(Rpc& rpc, grpc::Status (v1::Planish::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                 const Request& request, Deadline deadline) {
    rpc.Connect(deadline);
    grpc::ClientContext context;
    SetDeadline(context, deadline);
    Response response;
    const grpc::Status status = (planish.get()->*method)(&context, request, &response);
    if (!status.ok()) throw ErrorOfCall(status, rpc.target());
    return response;
  }

  const std::shared_ptr<grpc::Channel> channel;
  const std::unique_ptr<v1::Planish::Stub> planish;
};

Deadline DeadlineAfter(double seconds) {
  if (seconds <= 0) return std::nullopt;
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

Rpc::Rpc(const std::string& target, const ClientOptions& options)
    : target_(target), options_(options), stubs_(std::make_shared<Stubs>(NewChannel(target, options))) {}

Rpc::~Rpc() = default;

bool Rpc::Connect(Deadline deadline) {
  const auto patience = std::chrono::duration<double>(options_.connect_timeout_seconds);
  Clock::time_point until = Clock::now() + std::chrono::duration_cast<Clock::duration>(patience);
  if (deadline) until = std::min(until, *deadline);
  grpc::Channel& channel = *stubs_->channel;
  auto state = channel.GetState(true);
  for (; state == GRPC_CHANNEL_IDLE || state == GRPC_CHANNEL_CONNECTING; state = channel.GetState(true)) {
    if (channel.WaitForStateChange(state, until)) continue;
    throw Error(ErrorCode::kUnavailable, "SERVER_UNREACHABLE",
                "cannot reach the planish server at " + target_ + ": no connection in time");
  }
  return state == GRPC_CHANNEL_READY;
}

std::unique_ptr<Stream> Rpc::Unwrap(const v1::UnwrapRequest& request, Deadline deadline) {
  return std::make_unique<GrpcStream<v1::UnwrapResponse>>(
      deadline, target_,
      [this, &request](grpc::ClientContext* context) { return stubs_->planish->Unwrap(context, request); });
}

std::unique_ptr<Stream> Rpc::WatchJob(const v1::WatchJobRequest& request, Deadline deadline) {
  return std::make_unique<GrpcStream<v1::WatchJobResponse>>(
      deadline, target_,
      [this, &request](grpc::ClientContext* context) { return stubs_->planish->WatchJob(context, request); });
}

v1::Job Rpc::CreateJob(const v1::CreateJobRequest& request, Deadline deadline) {
  return stubs_->Unary(*this, &v1::Planish::Stub::CreateJob, request, deadline);
}

v1::Job Rpc::GetJob(const std::string& name) {
  v1::GetJobRequest request;
  request.set_name(name);
  return stubs_->Unary(*this, &v1::Planish::Stub::GetJob, request, DeadlineAfter(kUnarySeconds));
}

v1::ListJobsResponse Rpc::ListJobs(const v1::ListJobsRequest& request) {
  return stubs_->Unary(*this, &v1::Planish::Stub::ListJobs, request, DeadlineAfter(kUnarySeconds));
}

v1::Job Rpc::CancelJob(const std::string& name) {
  v1::CancelJobRequest request;
  request.set_name(name);
  return stubs_->Unary(*this, &v1::Planish::Stub::CancelJob, request, DeadlineAfter(kUnarySeconds));
}

void Rpc::DeleteJob(const std::string& name) {
  v1::DeleteJobRequest request;
  request.set_name(name);
  stubs_->Unary(*this, &v1::Planish::Stub::DeleteJob, request, DeadlineAfter(kUnarySeconds));
}

v1::Capabilities Rpc::GetCapabilities() {
  return stubs_->Unary(*this, &v1::Planish::Stub::GetCapabilities, v1::GetCapabilitiesRequest(),
                       DeadlineAfter(kUnarySeconds));
}

// Not by gRPC's callbacks: the last reference to the channel must not go on one of the channel's own threads, which
// would have to wait for themselves.
void Rpc::CancelJobInBackground(const std::string& name) {
  const std::lock_guard lock(cancels_mutex_);
  cancels_.emplace_back([stubs = stubs_, name] {
    grpc::ClientContext context;
    SetDeadline(context, DeadlineAfter(kCancelSeconds));
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::Job job;
    // Whether it got through shows in the job's own stream.
    stubs->planish->CancelJob(&context, request, &job);
  });
}

}  // namespace api
}  // namespace planish
