#include "tests/server/rpc/secure_server.h"

#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <utility>

#include "absl/strings/escaping.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/auth_context.h"
#include "grpcpp/security/credentials.h"
#include "gtest/gtest.h"
#include "server/rpc/service.h"
#include "tests/server/rpc/rpc_test_server.h"
#include "tests/testing/files.h"

namespace planish {
// Remembers whom the source under test took the last caller for.
class SecureServer::Recorder : public CallerSource {
 public:
  explicit Recorder(std::unique_ptr<CallerSource> source) : source_(std::move(source)) {}

  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const override {
    absl::StatusOr<Caller> caller = source_->Identify(context);
    const std::lock_guard lock(mutex_);
    last_ = caller.ok() ? *caller : Caller();
    return caller;
  }

  Caller last() const {
    const std::lock_guard lock(mutex_);
    return last_;
  }

 private:
  const std::unique_ptr<CallerSource> source_;
  mutable std::mutex mutex_;
  mutable Caller last_;  // guarded by mutex_
};

SecureServer::SecureServer() = default;

SecureServer::~SecureServer() {
  if (rpc_ != nullptr) rpc_->Shutdown(absl::Now());
}

void SecureServer::WriteAccess(const std::string& text) {
  ReplaceFile(dir_.Path("access.yaml"), text);
}

void SecureServer::WriteTls(const IssuedCertificate& issued, const std::string& client_ca) {
  ReplaceFile(dir_.Path("cert.pem"), issued.certificate);
  ReplaceFile(dir_.Path("key.pem"), issued.key);
  if (!client_ca.empty()) ReplaceFile(dir_.Path("ca.pem"), client_ca);
}

void SecureServer::Start(ClientAuth client_auth) {
  if (::access(dir_.Path("access.yaml").c_str(), F_OK) == 0) {
    auto opened = AccessSource::Open(dir_.Path("access.yaml"));
    ASSERT_TRUE(opened.ok()) << opened.status();
    access_ = *std::move(opened);
  }
  if (::access(dir_.Path("cert.pem").c_str(), F_OK) == 0) {
    const std::string ca = client_auth == ClientAuth::kNone ? "" : dir_.Path("ca.pem");
    auto loaded = TlsIdentity::Load({dir_.Path("cert.pem"), dir_.Path("key.pem"), ca}, client_auth, absl::Now());
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    tls_ = *loaded;
  }
  CallerRules rules;
  rules.access = access_.get();
  rules.peers = &peers_;
  rules.now = [this] { return absl::Now() + absl::Seconds(ahead_.load()); };
  rules.own_uid = geteuid();
  callers_ = std::make_unique<Recorder>(NewCallerSource(std::move(rules)));
  service_ = NewPlanishService(nullptr, nullptr, ServiceOptions(), &streams_);
  RpcServerOptions options;
  options.listen = {*ParseListenAddress("127.0.0.1:0"), *ParseListenAddress("unix:" + unix_path())};
  options.callers = callers_.get();
  options.tls = tls_;
  options.peers = &peers_;
  options.socket_mode = 0666;
  auto started = RpcServer::Start(options, {service_.get()});
  ASSERT_TRUE(started.ok()) << started.status();
  rpc_ = *std::move(started);
}

std::shared_ptr<grpc::Channel> SecureServer::TcpChannel(const TestClient& client) const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials();
  if (!client.ca.empty()) {
    credentials = grpc::SslCredentials({client.ca, client.certificate.key, client.certificate.certificate});
  }
  return grpc::CreateCustomChannel(tcp(), credentials, arguments);
}

std::shared_ptr<grpc::Channel> SecureServer::UnixChannel() const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel("unix:" + unix_path(), grpc::InsecureChannelCredentials(), arguments);
}

CallOutcome SecureServer::Call(const std::shared_ptr<grpc::Channel>& channel,
                               const std::vector<std::string>& authorization) const {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  for (const std::string& value : authorization) context.AddMetadata("authorization", value);
  v1::Capabilities answer;
  CallOutcome outcome;
  outcome.status = v1::Planish::NewStub(channel)->GetCapabilities(&context, v1::GetCapabilitiesRequest(), &answer);
  outcome.reason = InfoOf(outcome.status).reason();
  if (outcome.status.ok()) outcome.caller = callers_->last();
  if (const auto auth = context.auth_context(); auth != nullptr) {
    for (const grpc::string_ref& name : auth->FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME)) {
      outcome.server_name.assign(name.data(), name.size());
    }
  }
  return outcome;
}

std::string TokenLine(const std::string& token) {
  const TokenDigest digest = DigestOf(token);
  return "token-sha256: " + absl::BytesToHexString(std::string(digest.begin(), digest.end()));
}

}  // namespace planish
