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

// The W3C trace that calls belong to: `traceparent` or, if it is empty, the environment's TRACEPARENT where that is
// valid, or else a new one. Throws INVALID_ARGUMENT with TRACEPARENT_INVALID.
std::string TraceOf(const std::string& traceparent);

// Answers that carry no mesh must not take longer than this, connection included.
inline constexpr Seconds kUnaryLimit{20};
// A call in the background keeps its Rpc alive for so long at most.
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

  // Throws as Client::Client does.
  Rpc(const std::string& target, const ClientOptions& options);

  const std::string& target() const { return target_; }
  const ClientOptions& options() const { return options_; }
  // Whether there was a connection, ever.
  bool reached() const { return reached_; }

  // Waits for a connection until it fails, or connect_timeout or `deadline` pass. The next call says why it failed; a
  // peer that stays silent throws SERVER_UNREACHABLE or TLS_FAILED.
  void Connect(Deadline deadline);

  // For one call: its deadline, a span of the trace (TraceOf()), and the token. Throws OPTIONS_INVALID if the token's
  // file cannot be read.
  std::unique_ptr<grpc::ClientContext> NewContext(Deadline deadline, const std::string& trace) const;
  template <typename Stub = v1::Planish::Stub>
  Stub& stub() {
    return *std::get<std::unique_ptr<Stub>>(stubs_);
  }
  // What a status that is not OK says. Without a connection it tries TLS by itself to find out why, which may take a
  // few seconds if the server is slow.
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

  // The same for calls that may be repeated, for retry_timeout. `attempts`, if given, counts them.
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

  // Returns at once. The answer is not waited for: whoever stops or cancels watches the job's stream. The destructor
  // waits for calls that are still out, kBackgroundLimit at most.
  template <typename Request>
  void InBackground(Method<v1::Planish::Stub, Request, v1::Job> method, const std::string& job,
                    const std::string& trace) {
    // Not by gRPC's callbacks: the last reference to the channel must not go on one of the channel's own threads, which
    // would have to wait for themselves.
    const std::lock_guard lock(background_mutex_);
    background_.emplace_back([this, method, request = Named<Request>(job), trace] {
      // Whether it got through shows in the job's own stream, so nobody is told why it did not.
      (void)Caught([&] {
        v1::Job ignored;
        (stub().*method)(NewContext(DeadlineAfter(kBackgroundLimit), trace).get(), request, &ignored);
      });
    });
  }

 private:
  std::shared_ptr<grpc::Channel> NewChannel() const;
  std::string Token() const;
  // SERVER_UNREACHABLE or TLS_FAILED, with `message`, gRPC's own words.
  Error WhyUnreachable(const std::string& message) const;

  const std::string target_;
  const ClientOptions options_;
  const TlsProbe tls_;  // with what the files held
  const std::shared_ptr<grpc::Channel> channel_;
  const std::tuple<std::unique_ptr<v1::Planish::Stub>, std::unique_ptr<admin::v1::Admin::Stub>> stubs_;
  std::atomic<bool> reached_ = false;
  std::mutex background_mutex_;
  std::vector<std::jthread> background_;  // guarded by background_mutex_; joined before what they use goes
};

}  // namespace planish
