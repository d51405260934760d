// What a connection to a server needs beside its address: encryption, and who calls.
#pragma once

#include <memory>
#include <string>

#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"
#include "planish/client.h"

namespace planish {
inline namespace abi0 {

// Immutable after construction, so threads may share it.
class Connection {
 public:
  // Throws INVALID_ARGUMENT with OPTIONS_INVALID, see Client::Client.
  Connection(std::string target, const ClientOptions& options);

  const std::string& target() const { return target_; }
  bool uses_tls() const { return uses_tls_; }

  std::shared_ptr<grpc::Channel> NewChannel() const;

  // Adds what every call carries. Throws OPTIONS_INVALID if the token's file cannot be read.
  void Prepare(grpc::ClientContext& context) const;

  // Why no connection stands, with `message`, gRPC's own words: SERVER_UNREACHABLE or TLS_FAILED. Tries TLS by itself
  // to find out, which may take a few seconds if the server is slow.
  Error WhyUnreachable(const std::string& message) const;

 private:
  std::string Token() const;

  const std::string target_;
  const ClientOptions options_;
  const bool uses_tls_;
  std::string ca_, certificate_, key_;  // what the files held
};

}  // namespace abi0
}  // namespace planish
