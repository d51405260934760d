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
  std::int64_t upload_chunk_bytes = 0;  // data in one message of an upload; 0: 1 MiB
  CallListener on_call;                 // may be null

  // Certificate and key for all TCP addresses; null: plaintext. Unix sockets never need them.
  std::shared_ptr<TlsIdentity> tls;
  // Records which users connect to Unix sockets. Must outlive the server's Shutdown(). May be null.
  PeerUsers* peers = nullptr;
  // Mode of socket files, as for chmod.
  unsigned socket_mode = 0600;
  // Limit of MessageMemory: bytes that connections and arriving messages may take together, roughly, and bytes that
  // parsed messages may take. 0: no limit.
  std::int64_t quota_bytes = 0;
};

// A running gRPC server with its addresses. Thread-safe.
class RpcServer {
 public:
  // Starts to serve `services`, which must outlive the server. UNAVAILABLE if an address cannot be used; the message
  // has the address and the reason.
  static absl::StatusOr<std::unique_ptr<RpcServer>> Start(const RpcServerOptions& options,
                                                          const std::vector<RpcService*>& services);

  // Calls Shutdown(now) if that has not happened.
  ~RpcServer();

  // The addresses, with the port that the system chose in place of port 0.
  const std::vector<std::string>& addresses() const { return addresses_; }

  // Sets the health of planish.v1.Planish, which is SERVING at the start. The service "", which stands for the process,
  // is SERVING until Shutdown().
  void SetReady(bool ready);

  // Makes a health check from inside this process. Returns whether it is answered within `limit`.
  bool Answers(absl::Duration limit);

  // Refuses new calls, waits for running ones until `deadline`, then ends them. Removes socket files.
  void Shutdown(absl::Time deadline);

 private:
  explicit RpcServer(const RpcServerOptions& options);
  void Register(const std::vector<RpcService*>& services, grpc::ServerBuilder* builder);
  void ServeUnixSockets(std::vector<std::unique_ptr<UnixListener>> listeners, PeerUsers* peers);

  // Constant after Start(). Everything that calls use is declared before server_, whose destructor ends the calls.
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

  // Used by Start() and Shutdown() only.
  std::unique_ptr<PeerUsers> own_peers_;
  std::unique_ptr<UnixAcceptor> acceptor_;
  std::vector<std::unique_ptr<SocketFile>> socket_files_;
};

}  // namespace planish
