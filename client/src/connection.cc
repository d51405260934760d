#include <fstream>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "client/src/rpc.h"

namespace planish {
namespace {

Error Invalid(const std::string& message) {
  return Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID", message);
}

std::string ReadFile(const std::string& what, const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) throw Invalid("cannot read " + what + " " + path);
  return text.str();
}

std::string ReadPem(const std::string& what, const std::string& path) {
  if (path.empty()) return "";
  std::string pem = ReadFile(what, path);
  if (pem.find("-----BEGIN ") == std::string::npos) throw Invalid(path + " is no PEM file");
  return pem;
}

bool WantsTls(const std::string& target, const ClientOptions& options) {
  if (IsUnixTarget(target)) return false;
  return options.tls || !options.tls_ca_file.empty() || !options.tls_cert_file.empty() ||
         !options.tls_key_file.empty() || !options.tls_server_name.empty();
}

// A header's value: printable ASCII.
void CheckToken(const std::string& token) {
  for (const char c : token) {
    if (c <= ' ' || c > '~') throw Invalid("the token has a character that is no letter, digit or sign of ASCII");
  }
}

// gRPC wraps the cause in "failed to connect to all addresses; last error: UNKNOWN: ...: Connection refused".
std::string ConnectionCause(const std::string& message) {
  const std::size_t colon = message.rfind(": ");
  return colon == std::string::npos ? message : message.substr(colon + 2);
}

}  // namespace

Connection::Connection(std::string target, const ClientOptions& options)
    : target_(std::move(target)),
      options_(options),
      tls_{WantsTls(target_, options), "", "", "", options.tls_server_name} {
  if (options_.tls_cert_file.empty() != options_.tls_key_file.empty()) {
    throw Invalid("a client certificate takes two files: the certificate and its key");
  }
  if (tls_.uses_tls) {
    tls_.ca = ReadPem("the CA", options_.tls_ca_file);
    tls_.certificate = ReadPem("the client certificate", options_.tls_cert_file);
    tls_.key = ReadPem("the client's key", options_.tls_key_file);
  }
  const bool has_token = !options_.token.empty() || !options_.token_file.empty();
  if (has_token && !tls_.uses_tls && !options_.token_over_plaintext && !IsWithinThisMachine(target_)) {
    throw Invalid("the token would travel to " + target_ + " unencrypted, for everybody on the way to read: use TLS");
  }
  if (has_token) CheckToken(Token());
}

std::shared_ptr<grpc::Channel> Connection::NewChannel() const {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetMaxSendMessageSize(-1);
  // gRPC's own pace (20 s an attempt, 1 s and more between them) is for servers that talk to servers.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, static_cast<int>(1000 * options_.connect_timeout.count()));
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // A peer that vanished without a word is noticed within half a minute.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  // Clients to different servers, or to one server started anew, must not share connections and their back-off.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetUserAgentPrefix(std::string("planish/") + Version());
  // What stays on this machine must not go through a proxy on another.
  if (IsWithinThisMachine(target_)) arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  if (!tls_.uses_tls) return grpc::CreateCustomChannel(target_, grpc::InsecureChannelCredentials(), arguments);
  if (!options_.tls_server_name.empty()) arguments.SetSslTargetNameOverride(options_.tls_server_name);
  return grpc::CreateCustomChannel(target_, grpc::SslCredentials({tls_.ca, tls_.key, tls_.certificate}), arguments);
}

void Connection::Prepare(grpc::ClientContext& context) const {
  const std::string token = Token();
  if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
}

std::string Connection::Token() const {
  if (!options_.token.empty() || options_.token_file.empty()) return options_.token;
  const std::string token(absl::StripAsciiWhitespace(ReadFile("the token", options_.token_file)));
  if (token.empty()) throw Invalid("there is no token in " + options_.token_file);
  CheckToken(token);
  return token;
}

Error Connection::WhyUnreachable(const std::string& message) const {
  const std::string reason = "cannot reach the planish server at " + target_ + ": ";
  const Error unreachable(ErrorCode::kUnavailable, "SERVER_UNREACHABLE", reason + ConnectionCause(message));
  // A name that is not known would only be asked for once more.
  if (message.find("DNS resolution failed") != std::string::npos) return unreachable;
  const std::string fault = FindTlsFault(target_, tls_);
  return fault.empty() ? unreachable : Error(ErrorCode::kUnavailable, "TLS_FAILED", reason + fault);
}

}  // namespace planish
