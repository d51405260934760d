// The connection to a server: stubs, deadlines, traces, retries, and the conversion of statuses to errors.
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

// The W3C trace context for calls: `traceparent` or, if it is empty, the environment's TRACEPARENT if that is valid, or
// else a new one. Throws INVALID_ARGUMENT with TRACEPARENT_INVALID if `traceparent` is neither empty nor valid.
std::string TraceOf(const std::string& traceparent);

// Time limit of calls that transfer no mesh, including the time to connect.
inline constexpr Seconds kUnaryLimit{20};
// Time limit of background calls, for which the destructor of Rpc waits.
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

  // Waits for a connection. Returns also if the attempt fails: the next call then reports why. Throws
  // SERVER_UNREACHABLE or TLS_FAILED if connect_timeout or `deadline` passes before that.
  void Connect(Deadline deadline);

  // The context of one call: its deadline, a span of the trace (TraceOf()), and the token. Throws OPTIONS_INVALID if
  // the token's file cannot be read.
  std::unique_ptr<grpc::ClientContext> NewContext(Deadline deadline, const std::string& trace) const;
  template <typename Stub = v1::Planish::Stub>
  Stub& stub() {
    return *std::get<std::unique_ptr<Stub>>(stubs_);
  }
  // The error of a status that is not OK. If there is no connection, makes a TLS handshake to find out why, which may
  // take a few seconds if the server is slow.
  Error ErrorOf(const grpc::Status& status) const;

  // Makes one unary call and returns the response.
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

  // Like Call(), but retries for retry_timeout after temporary errors. `attempts`, if given, is incremented for each
  // attempt.
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

  // Calls `method` in the background and returns at once. The response is ignored: callers that stop or cancel a job
  // watch its stream. The destructor waits for running calls, at most kBackgroundLimit.
  template <typename Request>
  void InBackground(Method<v1::Planish::Stub, Request, v1::Job> method, const std::string& job,
                    const std::string& trace) {
    // A thread instead of gRPC's callbacks: a callback runs on a thread of the channel. If it dropped the last
    // reference to the channel, that thread would wait for itself.
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
  // Returns an error SERVER_UNREACHABLE or TLS_FAILED. `message`: gRPC's message.
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
