#include "server/rpc/unary_call.h"

namespace planish {
namespace {

class UnaryCall : public Call {
 public:
  UnaryCall(CallInfo info, TaskThreads* threads, const UnaryHandler* handler)
      : Call(std::move(info)), threads_(threads), handler_(*handler) {}

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    threads_->Post([self = shared_from_this(), this, message = std::move(message)] {
      const auto response = handler_(info(), *message);
      response.ok() ? EndWith(**response) : End(response.status());
    });
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
