// The connection: stubs, deadlines, traces and status translation.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "client/src/errors.h"
#include "client/src/retry.h"
#include "client/src/tls_probe.h"
#include "planish/admin/v1/admin.grpc.pb.h"
#include "planish/client.h"
#include "planish/v1/planish.grpc.pb.h"

namespace planish {

// The W3C trace of calls: `traceparent` or, if it is empty, the environment's TRACEPARENT if valid, or else a new one.
// Throws INVALID_ARGUMENT with TRACEPARENT_INVALID.
std::string TraceOf(const std::string& traceparent);

// Time limit of calls that transfer no mesh, including the connection.
inline constexpr Seconds kUnaryLimit{20};
// Time limit of background calls, which keep their Rpc alive.
inline constexpr Seconds kBackgroundLimit{5};

template <typename Request>
Request Named(const std::string& name) {
  Request request;
  request.set_name(name);
  return request;
}

// Thread-safe. Functions throw planish::Error.
class Rpc {
 public:
  template <typename Stub, typename Request, typename Response>
  using Method = grpc::Status (Stub::*)(grpc::ClientContext*, const Request&, Response*);

  // Throws the same errors as Client::Client.
  Rpc(const std::string& target, const ClientOptions& options);

  const std::string& target() const { return target_; }
  const ClientOptions& options() const { return options_; }
  // Whether there ever was a connection.
  bool reached() const { return reached_; }

  // Waits for a connection until it fails, or connect_timeout or `deadline` pass. The next call reports why it failed;
  // a silent peer throws SERVER_UNREACHABLE or TLS_FAILED.
  void Connect(Deadline deadline);

  // The context of one call: its deadline, a span of the trace (TraceOf()), and the token. Throws OPTIONS_INVALID if
  // the token's file cannot be read.
  std::unique_ptr<grpc::ClientContext> NewContext(Deadline deadline, const std::string& trace) const;
  template <typename Stub = v1::Planish::Stub>
  Stub& stub() {
    return *std::get<std::unique_ptr<Stub>>(stubs_);
  }
  // The error of a status that is not OK. Without a connection it tries TLS on its own to find out why, which may take
  // a few seconds if the server is slow.
  Error ErrorOf(const grpc::Status& status) const;

  // One unary call.
  template <typename Stub, typename Request, typename Response>
  Response Call(Method<Stub, Request, Response> method, const Request& request,
                Deadline deadline = DeadlineAfter(kUnaryLimit), const std::string& trace = TraceOf("")) {
    Connect(deadline);
    const auto context = NewContext(deadline, trace);
    Response response;
    const grpc::Status status = (stub<Stub>().*method)(context.get(), request, &response);
    if (!status.ok()) throw ErrorOf(status);
    return response;
  }

  // The same with retries, for retry_timeout. `attempts`, if given, is incremented for each attempt.
  template <typename Stub, typename Request, typename Response>
  Response Repeat(Method<Stub, Request, Response> method, const Request& request,
                  const std::string& trace = TraceOf(""), int* attempts = nullptr) {
    const Deadline deadline = DeadlineAfter(kUnaryLimit);
    Retry retry(target(), {options().retry_timeout, Seconds(0), options().backoff, deadline});
    while (true) {
      try {
        if (attempts != nullptr) ++*attempts;
        return Call(method, request, deadline, trace);
      } catch (const Error& error) {
        std::this_thread::sleep_for(retry.PauseAfter(error, reached_));
      }
    }
  }

  // Returns at once. The response is ignored: callers that stop or cancel a job watch its stream. The destructor waits
  // for running calls, at most kBackgroundLimit.
  template <typename Request>
  void InBackground(Method<v1::Planish::Stub, Request, v1::Job> method, const std::string& job,
                    const std::string& trace) {
    // Not by gRPC's callbacks: the last reference to the channel must not be dropped on one of the channel's own
    // threads, which would wait for itself.
    const std::lock_guard lock(background_mutex_);
    background_.emplace_back([this, method, request = Named<Request>(job), trace] {
      // Failures are ignored: the job's stream shows whether the call had an effect.
      (void)Caught([&] {
        v1::Job ignored;
        (stub().*method)(NewContext(DeadlineAfter(kBackgroundLimit), trace).get(), request, &ignored);
      });
    });
  }

 private:
  std::shared_ptr<grpc::Channel> NewChannel() const;
  std::string Token() const;
  // SERVER_UNREACHABLE or TLS_FAILED, with gRPC's `message`.
  Error WhyUnreachable(const std::string& message) const;

  const std::string target_;
  const ClientOptions options_;
  const TlsProbe tls_;  // with the contents of the files
  const std::shared_ptr<grpc::Channel> channel_;
  const std::tuple<std::unique_ptr<v1::Planish::Stub>, std::unique_ptr<admin::v1::Admin::Stub>> stubs_;
  std::atomic<bool> reached_ = false;
  std::mutex background_mutex_;
  std::vector<std::jthread> background_;  // guarded by background_mutex_; joined by the destructor
};

}  // namespace planish
