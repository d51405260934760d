// TLS and tokens of the library, against a small server of its own.
#include <absl/time/clock.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/base/target.h"
#include "planish/client.h"
#include "planish/v1/planish.grpc.pb.h"
#include "tests/testing/certificates.h"
#include "tests/testing/files.h"

namespace planish::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Service : public v1::Planish::Service {
 public:
  grpc::Status GetCapabilities(grpc::ServerContext* context, const v1::GetCapabilitiesRequest*,
                               v1::Capabilities*) override {
    const std::lock_guard lock(mutex_);
    const auto [begin, end] = context->client_metadata().equal_range("authorization");
    for (auto header = begin; header != end; ++header) {
      tokens_.emplace_back(header->second.data(), header->second.size());
    }
    return grpc::Status::OK;
  }

  // What came since the last call of this.
  std::vector<std::string> TakeTokens() {
    const std::lock_guard lock(mutex_);
    return std::exchange(tokens_, {});
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> tokens_;  // guarded by mutex_
};

class SecureClientTest : public ::testing::Test {
 protected:
  ~SecureClientTest() override {
    if (server_ != nullptr) server_->Shutdown(std::chrono::system_clock::now());
  }

  void Start(const std::shared_ptr<grpc::ServerCredentials>& credentials) {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", credentials, &port);
    builder.RegisterService(&service_);
    server_ = builder.BuildAndStart();
    target_ = "127.0.0.1:" + std::to_string(port);
  }

  void StartTls(const IssuedCertificate& issued, bool require_client = false) {
    grpc::SslServerCredentialsOptions options(require_client
                                                  ? GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY
                                                  : GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
    options.pem_key_cert_pairs = {{issued.key, issued.certificate}};
    if (require_client) options.pem_root_certs = authority_.certificate();
    Start(grpc::SslServerCredentials(options));
  }

  std::string Write(const std::string& name, const std::string& text) {
    PutFile(dir_.Path(name), text);
    return dir_.Path(name);
  }

  ClientOptions Trusting() {
    ClientOptions options;
    options.tls_ca_file = Write("ca.pem", authority_.certificate());
    return options;
  }

  IssuedCertificate Expired() const {
    CertificateRequest request;
    request.common_name = "late";
    request.addresses = {"127.0.0.1"};
    request.not_before = absl::Now() - absl::Hours(2);
    request.not_after = absl::Now() - absl::Hours(1);
    return authority_.Issue(request);
  }

  // The reason and message of a call; empty if it succeeds.
  std::string Fault(const ClientOptions& options, const std::string& target = "") {
    try {
      Client(target.empty() ? target_ : target, options).GetCapabilities();
    } catch (const Error& error) {
      return error.reason() + ": " + error.what();
    }
    return "";
  }

  TempDir dir_;
  TestAuthority authority_;
  Service service_;
  std::unique_ptr<grpc::Server> server_;
  std::string target_;
};

TEST(TargetAddress, WhatStaysOnThisMachine) {
  for (const char* target : {"unix:/x", "unix:///x", "localhost:1", "127.0.0.1:1", "127.9.9.9:1", "[::1]:1"}) {
    EXPECT_TRUE(IsWithinThisMachine(target)) << target;
  }
  for (const char* target : {"farm:1", "127.0.0.1.example:1", "10.0.0.1:1", "[::2]:1", "dns:///localhost:1", "::1",
                             "localhost.example:1", "0.0.0.0:1", ""}) {
    EXPECT_FALSE(IsWithinThisMachine(target)) << target;
  }
  EXPECT_EQ(ParseHostPort("[fe80::1]:70")->host, "fe80::1");
  EXPECT_FALSE(ParseHostPort("host"));
  EXPECT_FALSE(ParseHostPort("host:port"));
}

TEST_F(SecureClientTest, ATokenGoesWithEveryCallAndItsFileIsReadAnew) {
  Start(grpc::InsecureServerCredentials());
  EXPECT_EQ(Fault({}), "");
  EXPECT_THAT(service_.TakeTokens(), IsEmpty());
  ClientOptions options;
  options.token_file = Write("token", " one\n");
  Client client(target_, options);
  client.GetCapabilities();
  Write("token", "two\n");
  client.GetCapabilities();
  EXPECT_THAT(service_.TakeTokens(), ElementsAre("Bearer one", "Bearer two"));
  options.token = "three";
  EXPECT_EQ(Fault(options), "");
  EXPECT_THAT(service_.TakeTokens(), ElementsAre("Bearer three"));
  Write("token", "\n");
  EXPECT_THROW(client.GetCapabilities(), Error);
  EXPECT_THAT(service_.TakeTokens(), IsEmpty());
}

TEST_F(SecureClientTest, ATokenStaysOffOtherMachinesWithoutTls) {
  ClientOptions options;
  options.token = "secret";
  EXPECT_THAT(Fault(options, "192.0.2.1:7741"), HasSubstr("OPTIONS_INVALID: the token would travel to 192.0.2.1:7741"));
  options.token_over_plaintext = true;
  options.connect_timeout = Seconds(0.05);
  EXPECT_THAT(Fault(options, "192.0.2.1:7741"), HasSubstr("SERVER_UNREACHABLE"));
  options.token = "two words";
  EXPECT_THAT(Fault(options, "192.0.2.1:7741"), HasSubstr("the token has a character"));
}

TEST_F(SecureClientTest, Tls) {
  StartTls(IssueLocal(authority_));
  EXPECT_EQ(Fault(Trusting()), "");
  ClientOptions named = Trusting();
  named.tls_server_name = "localhost";
  EXPECT_EQ(Fault(named), "");
  ClientOptions with_token = Trusting();
  with_token.token = "t";
  EXPECT_EQ(Fault(with_token), "");
  EXPECT_THAT(service_.TakeTokens(), ElementsAre("Bearer t"));
}

TEST_F(SecureClientTest, WhyTlsFails) {
  StartTls(IssueLocal(authority_));
  EXPECT_THAT(Fault({}), AllOf(HasSubstr("TLS_FAILED: cannot reach the planish server at " + target_),
                               HasSubstr("the server there speaks TLS only")));
  ClientOptions name = Trusting();
  name.tls_server_name = "farm.example";
  EXPECT_THAT(Fault(name), HasSubstr("the server's certificate is not for farm.example"));
  ClientOptions authority;
  authority.tls_ca_file = Write("other.pem", TestAuthority("other").certificate());
  EXPECT_THAT(Fault(authority), HasSubstr("TLS_FAILED"));
  EXPECT_THAT(Fault(authority), HasSubstr("the server's certificate cannot be trusted"));
  ClientOptions system;
  system.tls = true;
  EXPECT_THAT(Fault(system), HasSubstr("the server's certificate cannot be trusted"));
}

TEST_F(SecureClientTest, AServerWhoseCertificateHasExpired) {
  StartTls(Expired());
  EXPECT_THAT(Fault(Trusting()), HasSubstr("TLS_FAILED"));
  EXPECT_THAT(Fault(Trusting()), HasSubstr("the server's certificate has expired"));
}

TEST_F(SecureClientTest, AServerWithoutTls) {
  Start(grpc::InsecureServerCredentials());
  EXPECT_THAT(Fault(Trusting()), HasSubstr("the server there does not speak TLS"));
}

TEST_F(SecureClientTest, CertificatesOfClients) {
  StartTls(IssueLocal(authority_), true);
  EXPECT_THAT(Fault(Trusting()), HasSubstr("the server asks for a client certificate"));
  const IssuedCertificate mine = IssueLocal(authority_, "mine");
  ClientOptions options = Trusting();
  options.tls_cert_file = Write("mine.pem", mine.certificate);
  options.tls_key_file = Write("mine-key.pem", mine.key);
  EXPECT_EQ(Fault(options), "");
  const IssuedCertificate other = IssueLocal(TestAuthority("other"), "mine");
  Write("mine.pem", other.certificate);
  EXPECT_THAT(Fault(options), HasSubstr("the client certificate does not belong to the client's key"));
  Write("mine-key.pem", other.key);
  EXPECT_THAT(Fault(options), HasSubstr("the server refuses the client certificate"));
  const IssuedCertificate late = Expired();
  Write("mine.pem", late.certificate);
  Write("mine-key.pem", late.key);
  EXPECT_THAT(Fault(options), HasSubstr("the client certificate has expired"));
}

TEST_F(SecureClientTest, OptionsThatCannotBe) {
  ClientOptions half;
  half.tls_key_file = Write("key.pem", IssueLocal(authority_).key);
  EXPECT_THAT(Fault(half, "h:1"), HasSubstr("OPTIONS_INVALID: a client certificate takes two files"));
  ClientOptions none;
  none.tls_ca_file = dir_.Path("none");
  EXPECT_THAT(Fault(none, "h:1"),
              HasSubstr("OPTIONS_INVALID: cannot read the CA " + dir_.Path("none") + ": No such file or directory"));
  none.tls_ca_file = Write("text", "hello");
  EXPECT_THAT(Fault(none, "h:1"), HasSubstr("is no PEM file"));
  ClientOptions token;
  token.token_file = dir_.Path("none");
  EXPECT_THAT(Fault(token, "unix:/x"), HasSubstr("OPTIONS_INVALID: cannot read the token " + dir_.Path("none")));
}

// Whoever has PLANISH_TLS in the environment still reaches a server on this machine's Unix socket.
TEST_F(SecureClientTest, UnixSocketsNeedNoTls) {
  ClientOptions options = Trusting();
  options.tls = true;
  EXPECT_THAT(Fault(options, "unix:" + dir_.Path("none")), HasSubstr("SERVER_UNREACHABLE"));
}

}  // namespace
}  // namespace planish::testing
