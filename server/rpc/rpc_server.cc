#include "server/rpc/rpc_server.h"

#include <algorithm>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "grpcpp/client_context.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/health_check_service_interface.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server_posix.h"

namespace planish {
namespace {

constexpr char kServiceName[] = "planish.v1.Planish";

// Bytes that a request may have in addition to the mesh, or to the piece of an upload.
constexpr std::int64_t kJobSlack = std::int64_t{16} << 20;
constexpr std::int64_t kPieceSlack = std::int64_t{64} << 10;
constexpr std::int64_t kDefaultPieceBytes = std::int64_t{1} << 20;

constexpr int kKeepaliveMs = 30'000;
constexpr int kKeepaliveTimeoutMs = 10'000;
constexpr int kMinPingIntervalMs = 5'000;
// Time limit of the TLS handshake. gRPC's own is two minutes.
constexpr int kHandshakeTimeoutMs = 20'000;
// Concurrent calls of one connection. A proxy opens more connections; an attacker's connection costs no more than this.
constexpr int kMaxStreams = 4096;

void Configure(grpc::ServerBuilder* builder) {
  // No limit here: Call and ReadWatch limit the length of messages. gRPC checks its own limit only when all of a
  // message has arrived.
  builder->SetMaxReceiveMessageSize(-1);
  // Calls with compressed messages end with UNIMPLEMENTED: a few bytes could inflate to any size before they are
  // checked.
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
  builder->AddChannelArgument(GRPC_ARG_ENABLE_PER_MESSAGE_DECOMPRESSION, 0);
  // A fixed window for the bytes that a stream may send before they are read. By default gRPC would start at 64 KiB and
  // grow to 4 MiB.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, static_cast<int>(ReadWatch::kLookaheadBytes));
  // Without this, two servers on one port would share its connections at random.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // A caller whose machine vanished is detected within kKeepaliveMs + kKeepaliveTimeoutMs, and its job is cancelled.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kMinPingIntervalMs);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeTimeoutMs);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxStreams);
}

MethodLimits LimitsOf(const RpcServerOptions& options) {
  constexpr std::int64_t kMost = std::numeric_limits<int>::max();
  const std::int64_t piece = options.upload_chunk_bytes > 0 ? options.upload_chunk_bytes : kDefaultPieceBytes;
  return {std::min(options.max_mesh_bytes + kJobSlack, kMost), std::min(piece + kPieceSlack, kMost)};
}

absl::Status CannotListen(const ListenAddress& address, const std::string& why) {
  return absl::UnavailableError(absl::StrCat("cannot listen on ", address.text, ": ", why));
}

}  // namespace

RpcServer::RpcServer(const RpcServerOptions& options)
    : memory_(options.quota_bytes),
      surroundings_{&memory_, &watch_, LimitsOf(options), options.on_call},
      entrance_(options.callers, &surroundings_) {}

void RpcServer::Register(const std::vector<RpcService*>& services, grpc::ServerBuilder* builder) {
  std::vector<RpcService*> all = services;
  all.push_back(&health_);
  std::vector<std::string> names;
  for (const RpcService* service : all) names.emplace_back(service->endpoints().front().method->service);
  names.push_back("grpc.reflection.v1alpha.ServerReflection");
  reflection_ = std::make_unique<ReflectionService>(std::move(names));
  all.push_back(reflection_.get());
  for (RpcService* service : all) {
    services_.push_back(entrance_.Open(*service));
    builder->RegisterService(services_.back().get());
  }
  builder->RegisterCallbackGenericService(&entrance_);
  if (memory_.is_limited()) builder->SetResourceQuota(memory_.quota());
}

absl::StatusOr<std::unique_ptr<RpcServer>> RpcServer::Start(const RpcServerOptions& options,
                                                            const std::vector<RpcService*>& services) {
  grpc::EnableDefaultHealthCheckService(false);

  grpc::ServerBuilder builder;
  Configure(&builder);
  std::vector<int> ports(options.listen.size(), 0);
  std::vector<std::unique_ptr<UnixListener>> listeners;
  std::unique_ptr<RpcServer> rpc_server(new RpcServer(options));
  for (std::size_t i = 0; i < options.listen.size(); ++i) {
    const ListenAddress& address = options.listen[i];
    if (address.unix_path.empty()) {
      builder.AddListeningPort(address.grpc,
                               options.tls != nullptr ? options.tls->credentials() : grpc::InsecureServerCredentials(),
                               &ports[i]);
      continue;
    }
    PLANISH_RETURN_IF_ERROR(RemoveStaleSocket(address.unix_path));
    absl::StatusOr<std::unique_ptr<UnixListener>> listener = UnixListener::Open(address.unix_path, options.socket_mode);
    if (!listener.ok()) return CannotListen(address, std::string(listener.status().message()));
    listeners.push_back(*std::move(listener));
    rpc_server->socket_files_.push_back(std::make_unique<SocketFile>(address.unix_path));
  }
  rpc_server->Register(services, &builder);

  rpc_server->server_ = builder.BuildAndStart();
  for (std::size_t i = 0; i < options.listen.size(); ++i) {
    const ListenAddress& address = options.listen[i];
    if (!address.unix_path.empty()) {
      rpc_server->addresses_.push_back(address.text);
      continue;
    }
    if (rpc_server->server_ == nullptr && ports[i] == 0) return CannotListen(address, WhyNotListening(address));
    rpc_server->addresses_.push_back(absl::StrCat(address.text.substr(0, address.text.rfind(':')), ":", ports[i]));
  }
  if (rpc_server->server_ == nullptr) return absl::UnavailableError("cannot start the gRPC server");
  rpc_server->SetReady(true);  // the service "" is SERVING from the start
  rpc_server->self_ = rpc_server->server_->InProcessChannel(grpc::ChannelArguments());
  rpc_server->ServeUnixSockets(std::move(listeners), options.peers);
  return rpc_server;
}

void RpcServer::ServeUnixSockets(std::vector<std::unique_ptr<UnixListener>> listeners, PeerUsers* peers) {
  if (listeners.empty()) return;
  if (peers == nullptr) {
    own_peers_ = std::make_unique<PeerUsers>();
    peers = own_peers_.get();
  }
  acceptor_ = std::make_unique<UnixAcceptor>(std::move(listeners), [server = server_.get(), peers](int fd) {
    const int known = peers->Add(fd);
    if (known >= 0) grpc::AddInsecureChannelFromFd(server, known);
  });
}

RpcServer::~RpcServer() {
  if (server_ != nullptr) Shutdown(absl::InfinitePast());
}

void RpcServer::SetReady(bool ready) {
  health_.Set(kServiceName, ready);
}

// Encodes the request by hand, since Debian has no generated code for the health service. A request without a field
// asks for the service "".
bool RpcServer::Answers(absl::Duration limit) {
  std::shared_ptr<grpc::Channel> self;
  {
    const std::lock_guard lock(mutex_);
    self = self_;
  }
  if (self == nullptr) return false;
  grpc::GenericStub health(self);
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + limit));
  grpc::CompletionQueue queue;
  const grpc::Slice nothing;
  const auto call =
      health.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::ByteBuffer(&nothing, 1), &queue);
  call->StartCall();
  grpc::ByteBuffer answer;
  grpc::Status status;
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);  // returns at the deadline at the latest
  queue.Shutdown();
  return status.ok();
}

void RpcServer::Shutdown(absl::Time deadline) {
  {
    const std::lock_guard lock(mutex_);
    self_ = nullptr;
  }
  acceptor_.reset();  // before the server ends, to which it passes connections
  server_->Shutdown(absl::ToChronoTime(deadline));
  socket_files_.clear();
}

}  // namespace planish
