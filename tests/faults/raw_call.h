// A call on planishd with messages as bytes, be they messages or not.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"
#include "grpcpp/completion_queue.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/support/slice.h"

namespace planish {

// How a call ended.
struct CallEnd {
  grpc::StatusCode code = grpc::StatusCode::OK;
  std::string reason;  // of the ErrorInfo; empty: there is none
  std::string message;

  bool ok() const { return code == grpc::StatusCode::OK; }
};

struct RawCallOptions {
  double limit_seconds = 60;  // the call fails with DEADLINE_EXCEEDED after that
  std::string token;          // empty: the call has no credentials
  grpc_compression_algorithm compression = GRPC_COMPRESS_NONE;
};

// One call, of whatever kind: each message that the server sends is read by Read(). Not thread-safe.
class RawCall {
 public:
  // "CreateJob" with one request. It fails with DEADLINE_EXCEEDED after `limit_seconds`.
  RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method, const std::string& request,
          double limit_seconds);
  // "/planish.v1.Planish/CreateJob".
  RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& path, const grpc::Slice& request,
          const RawCallOptions& options);
  ~RawCall();
  RawCall(const RawCall&) = delete;
  RawCall& operator=(const RawCall&) = delete;

  // The next message; empty after the last one.
  std::optional<std::string> Read();
  // After the last message; before it the call is cancelled.
  CallEnd Finish();

 private:
  bool Wait();

  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  grpc::GenericStub stub_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  bool ended_ = false;  // there is no more to read
  bool finished_ = false;
};

}  // namespace planish
