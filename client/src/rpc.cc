#include "client/src/rpc.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <utility>

#include "client/src/errors.h"
#include "core/base/trace_context.h"

namespace planish {
namespace {

using WallClock = std::chrono::system_clock;

// A call in the background keeps its Rpc alive for so long at most.
constexpr Seconds kBackgroundLimit{5};

std::uint64_t Entropy() {
  std::random_device random;
  return (std::uint64_t{random()} << 32) | random();
}

}  // namespace

std::string TraceOf(const std::string& traceparent) {
  const char* environment = std::getenv("TRACEPARENT");
  std::string trace = ParseTraceparent(!traceparent.empty() || environment == nullptr ? traceparent : environment);
  if (!trace.empty()) return trace;
  if (traceparent.empty()) return NewTraceparent(Entropy);
  throw Error(ErrorCode::kInvalidArgument, "TRACEPARENT_INVALID",
              "'" + traceparent + "' is no W3C traceparent, as 00-<32 hex digits>-<16 hex digits>-01 is one");
}

Rpc::Rpc(const std::string& target, const ClientOptions& options)
    : options_(options),
      connection_(target, options),
      channel_(connection_.NewChannel()),
      stubs_(v1::Planish::NewStub(channel_), admin::v1::Admin::NewStub(channel_)) {}

void Rpc::Connect(Deadline deadline) {
  WallClock::time_point until =
      WallClock::now() + std::chrono::duration_cast<WallClock::duration>(options_.connect_timeout);
  if (deadline) until = std::min(until, *deadline);
  auto state = channel_->GetState(true);
  for (; state == GRPC_CHANNEL_IDLE || state == GRPC_CHANNEL_CONNECTING; state = channel_->GetState(true)) {
    if (!channel_->WaitForStateChange(state, until)) throw connection_.WhyUnreachable("no connection in time");
  }
  if (state == GRPC_CHANNEL_READY) reached_ = true;
}

std::unique_ptr<grpc::ClientContext> Rpc::NewContext(Deadline deadline, const std::string& trace) const {
  auto context = std::make_unique<grpc::ClientContext>();
  if (deadline) context->set_deadline(*deadline);
  context->AddMetadata("traceparent", ChildTraceparent(trace, Entropy));
  connection_.Prepare(*context);
  return context;
}

Error Rpc::ErrorOf(const grpc::Status& status) const {
  google::rpc::Status rich;
  if (!status.error_details().empty() && rich.ParseFromString(status.error_details()) && rich.details_size() > 0) {
    return ErrorFrom(rich);
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) return connection_.WhyUnreachable(status.error_message());
  const bool is_late = status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
  rich.set_code(static_cast<int>(status.error_code()));
  rich.set_message(is_late ? "the time given to the call passed" : status.error_message());
  return ErrorFrom(rich);
}

// Not by gRPC's callbacks: the last reference to the channel must not go on one of the channel's own threads, which
// would have to wait for themselves. Whether the call got through shows in the job's own stream.
void Rpc::RunInBackground(std::function<void(grpc::ClientContext*)> call, const std::string& trace) {
  const std::lock_guard lock(background_mutex_);
  background_.emplace_back([this, call = std::move(call), trace] {
    std::unique_ptr<grpc::ClientContext> context;
    try {
      context = NewContext(DeadlineAfter(kBackgroundLimit), trace);
    } catch (const Error&) {
      return;  // no token any more: the call would be refused
    }
    call(context.get());
  });
}

}  // namespace planish
