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
#include "grpcpp/server_builder.h"
#include "server/rpc/call.h"
#include "server/rpc/caller_source.h"
#include "server/rpc/entrance.h"
#include "server/rpc/health.h"
#include "server/rpc/listen_address.h"
#include "server/rpc/message_memory.h"
#include "server/rpc/peer_users.h"
#include "server/rpc/read_watch.h"
#include "server/rpc/reflection.h"
#include "server/rpc/tls_identity.h"
#include "server/rpc/unix_acceptor.h"

namespace planish {

struct RpcServerOptions {
  std::vector<ListenAddress> listen;      // at least one
  const CallerSource* callers = nullptr;  // must outlive the server
  std::int64_t max_mesh_bytes = 0;
  std::int64_t upload_chunk_bytes = 0;  // of data in one message; 0: 1 MiB
  CallListener on_call;                 // null: nobody listens

  // For all TCP addresses; null: plaintext. Unix sockets never need it.
  std::shared_ptr<TlsIdentity> tls;
  // Learns who connects to Unix sockets. Must outlive the server's Shutdown(); null: nobody wants to know.
  PeerUsers* peers = nullptr;
  // Of socket files, as for chmod.
  unsigned socket_mode = 0600;
  // Bytes that connections and messages on the way in may take together, more or less, and bytes that parsed messages
  // may take; 0: no limit. MessageMemory.
  std::int64_t quota_bytes = 0;
};

// Thread-safe.
class RpcServer {
 public:
  // Serves `services` from its return on; they must outlive the server. UNAVAILABLE with a message that names the
  // address that cannot be had, and why.
  static absl::StatusOr<std::unique_ptr<RpcServer>> Start(const RpcServerOptions& options,
                                                          const std::vector<RpcService*>& services);

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
  explicit RpcServer(const RpcServerOptions& options);
  void Register(const std::vector<RpcService*>& services, grpc::ServerBuilder* builder);
  void ServeUnixSockets(std::vector<std::unique_ptr<UnixListener>> listeners, PeerUsers* peers);

  // Constant after Start(). All that calls use is above server_, which ends them.
  std::vector<std::string> addresses_;
  MessageMemory memory_;
  ReadWatch watch_;
  const CallSurroundings surroundings_;
  HealthService health_;
  std::unique_ptr<ReflectionService> reflection_;
  Entrance entrance_;
  std::vector<std::unique_ptr<grpc::Service>> services_;
  std::unique_ptr<grpc::Server> server_;

  std::mutex mutex_;
  std::shared_ptr<grpc::Channel> self_;  // guarded by mutex_; null after Shutdown()

  // Touched by Start() and Shutdown() only.
  std::unique_ptr<PeerUsers> own_peers_;
  std::unique_ptr<UnixAcceptor> acceptor_;
  std::vector<std::unique_ptr<SocketFile>> socket_files_;
};

}  // namespace planish
