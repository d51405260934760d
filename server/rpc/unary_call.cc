#include "server/rpc/unary_call.h"

namespace planish {
namespace {

class UnaryCall : public Call {
 public:
  UnaryCall(CallInfo info, TaskThreads* threads, const UnaryHandler* handler)
      : Call(std::move(info)), threads_(threads), handler_(*handler) {}

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    if (threads_ == nullptr) return Answer(*message);
    threads_->Post(info().caller.tenant, [self = shared_from_this(), this, message = std::move(message)] {
      if (info().context->IsCancelled()) return End(absl::CancelledError("the caller is gone"));
      Answer(*message);
    });
  }

  void Answer(ReceivedMessage& message) {
    const auto response = handler_(info(), message);
    response.ok() ? EndWith(**response) : End(response.status());
  }

  TaskThreads* const threads_;
  const UnaryHandler& handler_;
};

}  // namespace

CallMaker MakeUnaryCalls(TaskThreads* threads, UnaryHandler handler) {
  return [threads, handler = std::make_shared<const UnaryHandler>(std::move(handler))](CallInfo info) {
    return std::make_shared<UnaryCall>(std::move(info), threads, handler.get());
  };
}

}  // namespace planish
