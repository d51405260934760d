// Who planishd serves, and what it refuses to start with.
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <memory>
#include <thread>

#include "absl/strings/escaping.h"
#include "absl/time/clock.h"
#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"
#include "planish/v1/planish.grpc.pb.h"
#include "server/access/token_digest.h"
#include "tests/testing/certificates.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class PlanishdSecurityTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text, mode_t mode = 0600) {
    const std::string path = dir_.Path(name);
    ReplaceFile(path, text, mode);
    return path;
  }

  // "flag" for each token of the tenant "a".
  std::string WriteAccess(const std::vector<std::string>& tokens) {
    std::string text = "tenants:\n  a:\n    credentials:\n";
    for (const std::string& token : tokens) {
      const TokenDigest digest = DigestOf(token);
      text += "      - token-sha256: " + absl::BytesToHexString(std::string(digest.begin(), digest.end())) + "\n";
    }
    return Write("access.yaml", text);
  }

  std::string Refusal(std::vector<std::string> flags) {
    Daemon daemon(std::move(flags), false);
    EXPECT_EQ(daemon.Wait(), 2);
    return daemon.Output();
  }

  std::string Socket() const { return "unix:" + dir_.Path("s"); }

  static void Say(grpc::ClientContext* context, const std::string& token) {
    context->AddMetadata("authorization", "Bearer " + token);
  }

  grpc::StatusCode Ask(v1::Planish::Stub* stub, const std::string& token) {
    grpc::ClientContext context;
    Say(&context, token);
    v1::ListJobsResponse jobs;
    return stub->ListJobs(&context, v1::ListJobsRequest(), &jobs).error_code();
  }

  TempDir dir_;
};

TEST_F(PlanishdSecurityTest, AddressesBeyondThisMachineNeedTlsAndCredentials) {
  const TestAuthority authority;
  const IssuedCertificate mine = IssueLocal(authority);
  const std::string cert = "--tls-cert=" + Write("cert.pem", mine.certificate);
  const std::string key = "--tls-key=" + Write("key.pem", mine.key);
  const std::string ca = "--tls-client-ca=" + Write("ca.pem", authority.certificate());
  const std::string access = "--access-file=" + WriteAccess({"t"});
  for (const std::string listen : {"--listen=0.0.0.0:0", "--listen=[::]:0", "--listen=10.1.2.3:0"}) {
    EXPECT_THAT(Refusal({listen}), HasSubstr("--tls-cert and --tls-key")) << listen;
  }
  EXPECT_THAT(Refusal({"--listen=127.0.0.1:0", "--listen=0.0.0.0:0", access}),
              HasSubstr("other machines reach 0.0.0.0"));
  EXPECT_THAT(Refusal({"--listen=0.0.0.0:0", cert, key}), HasSubstr("give --access-file with tokens"));
  EXPECT_THAT(Refusal({"--listen=0.0.0.0:0", cert, key, ca, "--tls-client-auth=request"}),
              HasSubstr("give --access-file with tokens"));
  const std::vector<std::vector<std::string>> served = {
      {"--listen=0.0.0.0:0", cert, key, access},
      {"--listen=0.0.0.0:0", cert, key, ca},
      {"--listen=0.0.0.0:0", cert, key, ca, "--tls-client-auth=request", access},
      {"--listen=0.0.0.0:0", "--insecure"},
  };
  for (std::vector<std::string> flags : served) {
    flags.push_back("--workers=1");
    Daemon daemon(flags, true);
    EXPECT_TRUE(daemon.WaitReady()) << flags[1];
    const bool is_insecure = flags[1] == "--insecure";
    daemon.CloseSupervisor();
    EXPECT_EQ(daemon.Wait(), 0);
    EXPECT_EQ(daemon.Output().find("without encryption") != std::string::npos, is_insecure) << daemon.Output();
  }
}

TEST_F(PlanishdSecurityTest, FlagsAndFilesThatDoNotFit) {
  const TestAuthority authority;
  const IssuedCertificate mine = IssueLocal(authority);
  const std::string cert = "--tls-cert=" + Write("cert.pem", mine.certificate);
  const std::string key = "--tls-key=" + Write("key.pem", mine.key);
  const std::string ca = "--tls-client-ca=" + Write("ca.pem", authority.certificate());
  const std::string listen = "--listen=" + Socket();
  EXPECT_THAT(Refusal({listen, cert}), HasSubstr("--tls-cert needs --tls-key"));
  EXPECT_THAT(Refusal({listen, key}), HasSubstr("--tls-key needs --tls-cert"));
  EXPECT_THAT(Refusal({listen, ca}), HasSubstr("--tls-client-ca needs --tls-cert"));
  EXPECT_THAT(Refusal({listen, cert, key, "--tls-client-auth=require"}),
              HasSubstr("--tls-client-auth needs --tls-client-ca"));
  const std::string other = "--tls-key=" + Write("other.pem", IssueLocal(authority).key);
  EXPECT_THAT(Refusal({listen, cert, other}), HasSubstr("does not belong to the key in " + dir_.Path("other.pem")));
  EXPECT_THAT(Refusal({listen, "--access-file=" + dir_.Path("none")}), HasSubstr("cannot read the access file"));
  EXPECT_THAT(Refusal({listen, "--access-file=" + Write("bad.yaml", "tenants:\n  a:\n    quue: 3\n")}),
              HasSubstr("bad.yaml:3: tenants.a.quue: no such key"));
}

TEST_F(PlanishdSecurityTest, SocketsAreForTheirOwnerUnlessThereIsAnAccessFile) {
  for (const bool has_access : {false, true}) {
    std::vector<std::string> flags = {"--listen=" + Socket(), "--workers=1"};
    if (has_access) flags.push_back("--access-file=" + WriteAccess({"t"}));
    Daemon daemon(flags, true);
    ASSERT_TRUE(daemon.WaitReady());
    struct stat info = {};
    ASSERT_EQ(stat(dir_.Path("s").c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, has_access ? 0666u : 0600u);
  }
}

// Revocation is for new calls; whoever follows a job follows it to its end.
TEST_F(PlanishdSecurityTest, ARevokedTokenAndItsOpenStream) {
  WriteAccess({"leaving", "staying"});
  Daemon daemon({"--listen=" + Socket(), "--workers=1", "--access-file=" + dir_.Path("access.yaml")}, true);
  ASSERT_TRUE(daemon.WaitReady());
  const auto stub = v1::Planish::NewStub(grpc::CreateChannel(Socket(), grpc::InsecureChannelCredentials()));
  v1::UnwrapRequest request;
  request.mutable_spec()->set_draco(*EncodeDraco(Bump(150)));  // minutes of work
  request.mutable_spec()->mutable_options()->set_solver(v1::SOLVER_MINRES);
  request.mutable_spec()->mutable_options()->set_system(v1::SYSTEM_FULL);
  request.mutable_spec()->mutable_options()->set_preconditioner(v1::PRECONDITIONER_NONE);
  grpc::ClientContext context;
  Say(&context, "leaving");
  const auto stream = stub->Unwrap(&context, request);
  v1::UnwrapResponse response;
  ASSERT_TRUE(stream->Read(&response));
  const std::string job = response.event().job().name();
  ASSERT_EQ(Ask(stub.get(), "leaving"), grpc::StatusCode::OK);

  WriteAccess({"staying"});
  WaitUntil([&] { return Ask(stub.get(), "leaving") != grpc::StatusCode::OK; });
  EXPECT_EQ(Ask(stub.get(), "leaving"), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(Ask(stub.get(), "staying"), grpc::StatusCode::OK);
  ASSERT_TRUE(stream->Read(&response)) << "the stream goes on";
  grpc::ClientContext cancel;
  Say(&cancel, "staying");
  v1::CancelJobRequest name;
  name.set_name(job);
  v1::Job answer;
  EXPECT_TRUE(stub->CancelJob(&cancel, name, &answer).ok());
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  while (stream->Read(&response)) {
    if (response.event().has_job()) state = response.event().job().state();
  }
  EXPECT_EQ(state, v1::JOB_STATE_CANCELLED);
  EXPECT_TRUE(stream->Finish().ok());
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 0);
  EXPECT_THAT(daemon.Output(), HasSubstr("access.yaml read again"));
  EXPECT_THAT(daemon.Output(), Not(HasSubstr("leaving")));
}

}  // namespace
}  // namespace planish
