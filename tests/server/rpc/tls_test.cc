// Encryption, certificates of clients, and files that change under way.
#include <thread>

#include "gmock/gmock.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "server/rpc/tls_identity.h"
#include "tests/server/rpc/secure_server.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

constexpr char kAccess[] =
    "tenants:\n"
    "  studio:\n"
    "    credentials:\n"
    "      - certificate: render-7.studio\n"
    "      - certificate: Old Name\n"
    "        rights: [jobs]\n";

class TlsTest : public ::testing::Test {
 protected:
  TestClient Client(const IssuedCertificate& certificate = {}) const {
    TestClient client;
    client.ca = authority_.certificate();
    client.certificate = certificate;
    return client;
  }

  IssuedCertificate ClientCertificate(const std::vector<std::string>& dns_names,
                                      const std::string& common_name = "x") const {
    CertificateRequest request;
    request.common_name = common_name;
    request.dns_names = dns_names;
    return clients_.Issue(request);
  }

  void Start(ClientAuth client_auth = ClientAuth::kNone) {
    server_.WriteTls(IssueLocal(authority_, "first"), clients_.certificate());
    server_.Start(client_auth);
  }

  TestAuthority authority_{"servers"};
  TestAuthority clients_{"clients"};
  SecureServer server_;
};

// An open call: the health service's Watch, which says at once how things are and then every change.
class OpenCall {
 public:
  explicit OpenCall(const std::shared_ptr<grpc::Channel>& channel) : stub_(channel) {
    call_ = stub_.PrepareCall(&context_, "/grpc.health.v1.Health/Watch", &queue_);
    call_->StartCall(nullptr);
    Wait();
    const grpc::Slice request("\n\x12planish.v1.Planish");  // a HealthCheckRequest with that service
    call_->Write(grpc::ByteBuffer(&request, 1), nullptr);
    Wait();
  }
  ~OpenCall() {
    context_.TryCancel();
    grpc::Status status;
    call_->Finish(&status, nullptr);
    Wait();
  }

  bool Read() {
    call_->Read(&answer_, nullptr);
    return Wait();
  }

 private:
  bool Wait() {
    void* tag = nullptr;
    bool ok = false;
    return queue_.Next(&tag, &ok) && ok;
  }

  grpc::GenericStub stub_;
  grpc::CompletionQueue queue_;
  grpc::ClientContext context_;
  grpc::ByteBuffer answer_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
};

TEST_F(TlsTest, EncryptedAndPlaintextDoNotMix) {
  Start();
  const CallOutcome outcome = server_.Call(Client());
  ASSERT_TRUE(outcome.status.ok()) << outcome.status.error_message();
  EXPECT_EQ(outcome.server_name, "first");
  EXPECT_EQ(outcome.caller.tenant, kDefaultTenant);
  EXPECT_EQ(server_.Call(TestClient()).status.error_code(), grpc::StatusCode::UNAVAILABLE);
  TestClient other = Client();
  other.ca = clients_.certificate();
  EXPECT_EQ(server_.Call(other).status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_TRUE(server_.Call(server_.UnixChannel()).status.ok()) << "Unix sockets stay as they are";
}

TEST_F(TlsTest, ANewCertificateIsForNewConnectionsAndOpenCallsGoOn) {
  Start();
  const auto before = server_.TcpChannel(Client());
  OpenCall call(before);
  ASSERT_TRUE(call.Read());
  EXPECT_EQ(server_.Call(before).server_name, "first");
  server_.WriteTls(IssueLocal(authority_, "second"), "");
  ASSERT_TRUE(server_.tls().Reload(absl::Now()).ok());
  EXPECT_EQ(server_.Call(Client()).server_name, "second");
  EXPECT_EQ(server_.Call(before).server_name, "first") << "its connection is as old as it was";
  server_.rpc().SetReady(false);
  EXPECT_TRUE(call.Read());
  // And once more: gRPC asks for changes at each connection.
  server_.WriteTls(IssueLocal(authority_, "third"), "");
  ASSERT_TRUE(server_.tls().Reload(absl::Now()).ok());
  EXPECT_EQ(server_.Call(Client()).server_name, "third");
  EXPECT_EQ(server_.Call(Client()).server_name, "third");
}

TEST_F(TlsTest, AWrongPairIsNotTaken) {
  Start();
  const absl::Time not_after = server_.tls().not_after();
  IssuedCertificate mixed = IssueLocal(authority_, "second");
  mixed.key = IssueLocal(authority_).key;
  server_.WriteTls(mixed, "");
  EXPECT_THAT(std::string(server_.tls().Reload(absl::Now()).message()), HasSubstr("does not belong to the key"));
  EXPECT_EQ(server_.Call(Client()).server_name, "first");
  CertificateRequest expired;
  expired.common_name = "late";
  expired.not_before = absl::Now() - absl::Hours(2);
  expired.not_after = absl::Now() - absl::Hours(1);
  server_.WriteTls(authority_.Issue(expired), "");
  EXPECT_THAT(std::string(server_.tls().Reload(absl::Now()).message()), HasSubstr("expired"));
  EXPECT_EQ(server_.Call(Client()).server_name, "first");
  EXPECT_EQ(server_.tls().not_after(), not_after) << "of the certificate in force";
}

TEST_F(TlsTest, RequiredCertificates) {
  server_.WriteAccess(kAccess);
  Start(ClientAuth::kRequire);
  EXPECT_EQ(server_.Call(Client()).status.error_code(), grpc::StatusCode::UNAVAILABLE) << "none";
  EXPECT_EQ(server_.Call(Client(IssueLocal(authority_))).status.error_code(), grpc::StatusCode::UNAVAILABLE)
      << "signed by an authority that is not the clients'";
  CertificateRequest expired;
  expired.common_name = "x";
  expired.dns_names = {"render-7.studio"};
  expired.not_before = absl::Now() - absl::Hours(2);
  expired.not_after = absl::Now() - absl::Hours(1);
  EXPECT_EQ(server_.Call(Client(clients_.Issue(expired))).status.error_code(), grpc::StatusCode::UNAVAILABLE);

  const CallOutcome render = server_.Call(Client(ClientCertificate({"alias.studio", "Render-7.studio"})));
  ASSERT_TRUE(render.status.ok()) << render.status.error_message();
  EXPECT_EQ(render.caller.tenant, "studio");
  EXPECT_EQ(render.caller.credential, "certificate render-7.studio");
  const CallOutcome named = server_.Call(Client(ClientCertificate({}, "old name")));
  ASSERT_TRUE(named.status.ok()) << named.status.error_message();
  EXPECT_FALSE(named.caller.rights.submit);
  EXPECT_EQ(server_.Call(Client(ClientCertificate({"render-8.studio"}))).reason, "CREDENTIALS_INVALID");
  EXPECT_EQ(server_.Call(Client(ClientCertificate({"other.studio"}, "render-7.studio"))).reason, "CREDENTIALS_INVALID")
      << "a common name counts only without DNS names";
}

TEST_F(TlsTest, RequestedCertificates) {
  server_.WriteAccess(std::string(kAccess) + "      - " + TokenLine("t") + "\n        name: t\n");
  Start(ClientAuth::kRequest);
  EXPECT_EQ(server_.Call(Client()).reason, "CREDENTIALS_MISSING");
  TestClient with_token = Client();
  with_token.authorization = {"Bearer t"};
  EXPECT_EQ(server_.Call(with_token).caller.credential, "token t");
  TestClient with_both = Client(ClientCertificate({"render-7.studio"}));
  EXPECT_EQ(server_.Call(with_both).caller.credential, "certificate render-7.studio");
  with_both.authorization = {"Bearer t"};
  EXPECT_EQ(server_.Call(with_both).caller.credential, "token t");
  with_both.authorization = {"Bearer wrong"};
  EXPECT_EQ(server_.Call(with_both).reason, "CREDENTIALS_INVALID");
  EXPECT_EQ(server_.Call(Client(IssueLocal(authority_))).status.error_code(), grpc::StatusCode::UNAVAILABLE)
      << "who sends a certificate must have a good one";
}

TEST_F(TlsTest, WithoutAnAccessFileACertificateIsEnough) {
  Start(ClientAuth::kRequire);
  const CallOutcome outcome = server_.Call(Client(ClientCertificate({"any.studio"})));
  ASSERT_TRUE(outcome.status.ok()) << outcome.status.error_message();
  EXPECT_EQ(outcome.caller.tenant, kDefaultTenant);
  EXPECT_EQ(outcome.caller.credential, "certificate any.studio");
}

TEST_F(TlsTest, ACertificateExpiresWhileItsConnectionIsOpen) {
  Start(ClientAuth::kRequire);
  const auto channel = server_.TcpChannel(Client(ClientCertificate({"any.studio"})));
  EXPECT_TRUE(server_.Call(channel).status.ok());
  server_.Advance(absl::Hours(24 * 31));
  EXPECT_EQ(server_.Call(channel).reason, "CREDENTIALS_EXPIRED");
}

TEST_F(TlsTest, TheClientsAuthorityChanges) {
  Start(ClientAuth::kRequire);
  const IssuedCertificate old_one = ClientCertificate({"any.studio"});
  EXPECT_TRUE(server_.Call(Client(old_one)).status.ok());
  const TestAuthority next("next");
  CertificateRequest request;
  request.common_name = "any.studio";
  const IssuedCertificate new_one = next.Issue(request);
  EXPECT_EQ(server_.Call(Client(new_one)).status.error_code(), grpc::StatusCode::UNAVAILABLE);
  server_.WriteTls(IssueLocal(authority_), next.certificate());
  ASSERT_TRUE(server_.tls().Reload(absl::Now()).ok());
  EXPECT_TRUE(server_.Call(Client(new_one)).status.ok());
  EXPECT_EQ(server_.Call(Client(old_one)).status.error_code(), grpc::StatusCode::UNAVAILABLE);
}

}  // namespace
}  // namespace planish
