// Calls with one request and one response.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "server/rpc/call.h"
#include "server/rpc/task_threads.h"

namespace planish {

// Returns the response to `message`, or an error. Runs on a task thread; not called if the call was cancelled before.
using UnaryHandler = std::function<absl::StatusOr<std::unique_ptr<google::protobuf::Message>>(
    const CallInfo&, ReceivedMessage& message)>;

// Makes calls that `handler` answers. `threads` outlives them; null: `handler` runs at once, on gRPC's thread.
CallMaker MakeUnaryCalls(TaskThreads* threads, UnaryHandler handler);

// A handler from a function on parsed messages: absl::StatusOr<Response> handle(const CallInfo&, Request*).
template <class Request, class Response, class Handle>
UnaryHandler ParsedUnary(Handle handle) {
  return [handle = std::move(handle)](
             const CallInfo& info,
             ReceivedMessage& message) -> absl::StatusOr<std::unique_ptr<google::protobuf::Message>> {
    Request request;
    if (absl::Status status = message.Parse(&request); !status.ok()) return status;
    absl::StatusOr<Response> response = handle(info, &request);
    if (!response.ok()) return response.status();
    return std::make_unique<Response>(*std::move(response));
  };
}

}  // namespace planish
