// A server that asks who calls, on TCP and on a Unix socket, and clients for it.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "grpcpp/channel.h"
#include "planish/v1/planish.grpc.pb.h"
#include "server/access/access_source.h"
#include "server/rpc/call.h"
#include "server/rpc/caller_source.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/stream_counter.h"
#include "tests/testing/certificates.h"
#include "tests/testing/files.h"

namespace planish {

// What a client brings along; PEM.
struct TestClient {
  std::string ca;  // empty: plaintext
  IssuedCertificate certificate;
  std::vector<std::string> authorization;  // headers
};

// What became of a call.
struct CallOutcome {
  grpc::Status status;
  std::string reason;       // of the ErrorInfo
  Caller caller;            // who the server took the client for
  std::string server_name;  // common name of the server's certificate
};

class SecureServer {
 public:
  SecureServer();
  ~SecureServer();

  // Before Start(). An access file with this text.
  void WriteAccess(const std::string& text);
  // TLS with these files; anything but a path that was written before is written.
  void WriteTls(const IssuedCertificate& issued, const std::string& client_ca);

  void Start(ClientAuth client_auth = ClientAuth::kNone);

  AccessSource& access() { return *access_; }
  TlsIdentity& tls() { return *tls_; }
  RpcServer& rpc() { return *rpc_; }
  // Moves the clock by which credentials expire.
  void Advance(absl::Duration duration) { ahead_ = ahead_ + absl::ToInt64Seconds(duration); }

  const std::string& tcp() const { return rpc_->addresses()[0]; }
  std::string unix_path() const { return dir_.Path("socket"); }
  TempDir& dir() { return dir_; }

  // A connection of its own for each.
  std::shared_ptr<grpc::Channel> TcpChannel(const TestClient& client) const;
  std::shared_ptr<grpc::Channel> UnixChannel() const;

  // GetCapabilities, which anybody may call whom the server knows.
  CallOutcome Call(const std::shared_ptr<grpc::Channel>& channel,
                   const std::vector<std::string>& authorization = {}) const;
  // The same over TCP, on a connection of its own.
  CallOutcome Call(const TestClient& client) const { return Call(TcpChannel(client), client.authorization); }

 private:
  class Recorder;

  TempDir dir_;
  std::unique_ptr<AccessSource> access_;
  std::shared_ptr<TlsIdentity> tls_;
  std::atomic<std::int64_t> ahead_ = 0;  // seconds
  PeerUsers peers_;
  std::unique_ptr<Recorder> callers_;
  StreamCounter streams_;
  std::unique_ptr<RpcService> service_;
  std::unique_ptr<RpcServer> rpc_;
};

// "token-sha256: ..." of an access file.
std::string TokenLine(const std::string& token);

}  // namespace planish
