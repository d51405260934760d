#include "client/src/rpc.h"

#include <algorithm>
#include <cstdlib>

#include "absl/strings/ascii.h"
#include "core/base/random_id.h"
#include "core/base/read_file.h"
#include "core/base/target.h"
#include "core/base/trace_context.h"

namespace planish {
namespace {

std::string ReadFile(const std::string& what, const std::string& path) {
  absl::StatusOr<std::string> text = ReadTextFile(what, path);
  if (!text.ok()) throw Invalid("OPTIONS_INVALID", std::string(text.status().message()));
  return *std::move(text);
}

std::string ReadPem(const std::string& what, const std::string& path) {
  if (path.empty()) return "";
  std::string pem = ReadFile(what, path);
  if (pem.find("-----BEGIN ") == std::string::npos) throw Invalid("OPTIONS_INVALID", path + " is no PEM file");
  return pem;
}

// The TLS settings of `options`, with the contents of the files in place of their names.
TlsProbe TlsOf(const std::string& target, const ClientOptions& options) {
  if (options.tls_cert_file.empty() != options.tls_key_file.empty()) {
    throw Invalid("OPTIONS_INVALID", "a client certificate takes two files: the certificate and its key");
  }
  const bool is_asked_for =
      options.tls || !options.tls_ca_file.empty() || !options.tls_cert_file.empty() || !options.tls_server_name.empty();
  if (!is_asked_for || IsUnixTarget(target)) return {};
  return {true, ReadPem("the CA", options.tls_ca_file), ReadPem("the client certificate", options.tls_cert_file),
          ReadPem("the client's key", options.tls_key_file), options.tls_server_name};
}

// Throws OPTIONS_INVALID unless the token is a valid header value: printable ASCII without spaces.
void CheckToken(const std::string& token) {
  for (const char c : token) {
    if (c <= ' ' || c > '~')
      throw Invalid("OPTIONS_INVALID", "the token has a character that is no letter, digit or sign of ASCII");
  }
}

// The cause at the end of a gRPC message such as "failed to connect to all addresses; last error: UNKNOWN: ...:
// Connection refused".
std::string ConnectionCause(const std::string& message) {
  const std::size_t colon = message.rfind(": ");
  return colon == std::string::npos ? message : message.substr(colon + 2);
}

}  // namespace

std::string TraceOf(const std::string& traceparent) {
  const char* environment = std::getenv("TRACEPARENT");
  std::string trace = ParseTraceparent(!traceparent.empty() || environment == nullptr ? traceparent : environment);
  if (!trace.empty()) return trace;
  if (traceparent.empty()) return NewTraceparent(Entropy);
  throw Invalid("TRACEPARENT_INVALID",
                "'" + traceparent + "' is no W3C traceparent, as 00-<32 hex digits>-<16 hex digits>-01 is one");
}

Rpc::Rpc(const std::string& target, const ClientOptions& options)
    : target_(target),
      options_(options),
      tls_(TlsOf(target, options)),
      channel_(NewChannel()),
      stubs_(v1::Planish::NewStub(channel_), admin::v1::Admin::NewStub(channel_)) {
  if (options.token.empty() && options.token_file.empty()) return;
  if (!tls_.uses_tls && !options.token_over_plaintext && !IsWithinThisMachine(target)) {
    throw Invalid("OPTIONS_INVALID",
                  "the token would travel to " + target + " unencrypted, for everybody on the way to read: use TLS");
  }
  CheckToken(Token());
}

std::shared_ptr<grpc::Channel> Rpc::NewChannel() const {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetMaxSendMessageSize(-1);
  // gRPC's defaults (20 s for an attempt, 1 s and more between attempts) are too slow for people who wait.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, static_cast<int>(1000 * options_.connect_timeout.count()));
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // Notices a silently vanished peer within half a minute.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  // Two Rpc objects must not share a connection: its back-off after failures would delay both.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetUserAgentPrefix(std::string("planish/") + Version());
  // Connections within this machine must not use a proxy.
  if (IsWithinThisMachine(target_)) arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  if (!tls_.uses_tls) return grpc::CreateCustomChannel(target_, grpc::InsecureChannelCredentials(), arguments);
  if (!options_.tls_server_name.empty()) arguments.SetSslTargetNameOverride(options_.tls_server_name);
  return grpc::CreateCustomChannel(target_, grpc::SslCredentials({tls_.ca, tls_.key, tls_.certificate}), arguments);
}

std::string Rpc::Token() const {
  if (!options_.token.empty() || options_.token_file.empty()) return options_.token;
  const std::string token(absl::StripAsciiWhitespace(ReadFile("the token", options_.token_file)));
  if (token.empty()) throw Invalid("OPTIONS_INVALID", "there is no token in " + options_.token_file);
  CheckToken(token);
  return token;
}

Error Rpc::WhyUnreachable(const std::string& message) const {
  const std::string reason = "cannot reach the planish server at " + target_ + ": ";
  const Error unreachable(ErrorCode::kUnavailable, "SERVER_UNREACHABLE", reason + ConnectionCause(message));
  // Probing an unknown host name would only repeat the failed lookup.
  if (message.find("DNS resolution failed") != std::string::npos) return unreachable;
  const std::string fault = FindTlsFault(target_, tls_);
  return fault.empty() ? unreachable : Error(ErrorCode::kUnavailable, "TLS_FAILED", reason + fault);
}

void Rpc::Connect(Deadline deadline) {
  auto until = std::chrono::system_clock::now() +
               std::chrono::duration_cast<std::chrono::system_clock::duration>(options().connect_timeout);
  if (deadline) until = std::min(until, *deadline);
  auto state = channel_->GetState(true);
  for (; state == GRPC_CHANNEL_IDLE || state == GRPC_CHANNEL_CONNECTING; state = channel_->GetState(true)) {
    if (!channel_->WaitForStateChange(state, until)) throw WhyUnreachable("no connection in time");
  }
  if (state == GRPC_CHANNEL_READY) reached_ = true;
}

std::unique_ptr<grpc::ClientContext> Rpc::NewContext(Deadline deadline, const std::string& trace) const {
  auto context = std::make_unique<grpc::ClientContext>();
  if (deadline) context->set_deadline(*deadline);
  context->AddMetadata("traceparent", ChildTraceparent(trace, Entropy));
  const std::string token = Token();
  if (!token.empty()) context->AddMetadata("authorization", "Bearer " + token);
  return context;
}

Error Rpc::ErrorOf(const grpc::Status& status) const {
  google::rpc::Status rich;
  if (!status.error_details().empty() && rich.ParseFromString(status.error_details()) && rich.details_size() > 0) {
    return ErrorFrom(rich);
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) return WhyUnreachable(status.error_message());
  const bool is_late = status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
  rich.set_code(static_cast<int>(status.error_code()));
  rich.set_message(is_late ? "the time given to the call passed" : status.error_message());
  return ErrorFrom(rich);
}

}  // namespace planish
