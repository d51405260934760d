#include "client/src/rpc.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <random>

#include "core/base/trace_context.h"

namespace planish {
namespace {

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
    : connection_(target, options),
      channel_(connection_.NewChannel()),
      stubs_(v1::Planish::NewStub(channel_), admin::v1::Admin::NewStub(channel_)) {}

void Rpc::Connect(Deadline deadline) {
  auto until = std::chrono::system_clock::now() +
               std::chrono::duration_cast<std::chrono::system_clock::duration>(options().connect_timeout);
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

}  // namespace planish
