// A gRPC server on some addresses, with health and reflection.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "grpcpp/channel.h"
#include "grpcpp/impl/service_type.h"
#include "grpcpp/server.h"
#include "server/rpc/call_observer.h"
#include "server/rpc/listen_address.h"

namespace planish {

struct RpcServerOptions {
  std::vector<ListenAddress> listen;  // at least one
  std::int64_t max_mesh_bytes = 0;
  CallListener on_call;  // null: nobody listens
};

// Thread-safe.
class RpcServer {
 public:
  // Serves `services` from its return on; they must outlive the server. UNAVAILABLE with a message that names the
  // address that cannot be had, and why.
  static absl::StatusOr<std::unique_ptr<RpcServer>> Start(const RpcServerOptions& options,
                                                          const std::vector<grpc::Service*>& services);

  // Shutdown(now) if nobody did.
  ~RpcServer();

  // With the port that the system chose in place of port 0.
  const std::vector<std::string>& addresses() const { return addresses_; }

  // What grpc.health.v1 says of planish.v1.Planish from now on; SERVING at the start. The service "", which means that
  // the process lives, is SERVING until Shutdown().
  void SetReady(bool ready);

  // Whether a health check, made from inside this process, is answered within `limit`.
  bool Answers(absl::Duration limit);

  // Takes no new calls, waits for those under way until `deadline`, then cuts them off. Removes socket files.
  void Shutdown(absl::Time deadline);

 private:
  RpcServer() = default;

  // Constant after Start().
  std::vector<std::string> addresses_;
  std::unique_ptr<grpc::Server> server_;

  std::vector<std::unique_ptr<SocketFile>> socket_files_;  // touched by Start() and Shutdown() only

  std::mutex mutex_;
  std::shared_ptr<grpc::Channel> self_;  // guarded by mutex_; null after Shutdown()
};

}  // namespace planish
