// Tokens, users of Unix sockets, and what each may do.
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <thread>

#include "gmock/gmock.h"
#include "grpcpp/create_channel_posix.h"
#include "gtest/gtest.h"
#include "server/rpc/peer_users.h"
#include "tests/server/rpc/rpc_test_server.h"
#include "tests/server/rpc/secure_server.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr uid_t kNobody = 65534;

std::string Access(const std::string& more = "") {
  return "tenants:\n"
         "  lighting:\n"
         "    credentials:\n"
         "      - " +
         TokenLine("good") +
         "\n        name: farm\n"
         "      - " +
         TokenLine("old") +
         "\n        expires: 2020-01-01T00:00:00Z\n"
         "      - " +
         TokenLine("watcher") + "\n        rights: [jobs]\n" + more;
}

class CredentialsTest : public ::testing::Test {
 protected:
  // The server's answers to clients without TLS.
  CallOutcome With(const std::vector<std::string>& authorization) {
    TestClient client;
    client.authorization = authorization;
    return server_.Call(client);
  }

  // A channel of another user of this machine: only this thread becomes that user, for as long as connecting takes.
  std::shared_ptr<grpc::Channel> ChannelOf(uid_t uid) {
    int fd = -1;
    std::thread([&] {
      sockaddr_un address = {};
      address.sun_family = AF_UNIX;
      server_.unix_path().copy(address.sun_path, sizeof(address.sun_path) - 1);
      fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
      ASSERT_EQ(syscall(SYS_setresuid, -1, uid, -1), 0);
      EXPECT_EQ(connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
      ASSERT_EQ(syscall(SYS_setresuid, -1, 0, -1), 0);
    }).join();
    fcntl(fd, F_SETFL, O_NONBLOCK);
    return grpc::CreateInsecureChannelFromFd("other-user", fd);
  }

  SecureServer server_;
};

TEST_F(CredentialsTest, Tokens) {
  server_.WriteAccess(Access());
  server_.Start();
  const CallOutcome good = With({"Bearer good"});
  ASSERT_TRUE(good.status.ok()) << good.status.error_message();
  EXPECT_EQ(good.caller.tenant, "lighting");
  EXPECT_EQ(good.caller.credential, "token farm");
  EXPECT_TRUE(With({"bearer good"}).status.ok());

  const std::vector<std::pair<std::vector<std::string>, std::string>> refused = {
      {{}, "CREDENTIALS_MISSING"},
      {{"Bearer bad"}, "CREDENTIALS_INVALID"},
      {{"Bearer "}, "CREDENTIALS_INVALID"},
      {{"Bearer"}, "CREDENTIALS_INVALID"},
      {{"good"}, "CREDENTIALS_INVALID"},
      {{"Basic good"}, "CREDENTIALS_INVALID"},
      {{"Bearer good", "Bearer good"}, "CREDENTIALS_INVALID"},
      {{"Bearer good", "Bearer bad"}, "CREDENTIALS_INVALID"},
      {{"Bearer " + std::string(4000, 'x')}, "CREDENTIALS_INVALID"},
      {{"Bearer old"}, "CREDENTIALS_EXPIRED"},
  };
  for (const auto& [authorization, reason] : refused) {
    const CallOutcome outcome = With(authorization);
    EXPECT_EQ(outcome.status.error_code(), grpc::StatusCode::UNAUTHENTICATED) << reason;
    EXPECT_EQ(outcome.reason, reason);
    EXPECT_THAT(outcome.status.error_message(), Not(HasSubstr("good")));
  }
}

TEST_F(CredentialsTest, WithoutAnAccessFileTcpServesEverybody) {
  server_.Start();
  const CallOutcome outcome = With({"Bearer whatever"});
  ASSERT_TRUE(outcome.status.ok());
  EXPECT_EQ(outcome.caller.tenant, kDefaultTenant);
  EXPECT_EQ(outcome.caller.rights, Rights::All());
}

TEST_F(CredentialsTest, ARevokedTokenIsRefusedAtOnceOnOpenConnectionsToo) {
  server_.WriteAccess(Access());
  server_.Start();
  const auto channel = server_.TcpChannel({});
  EXPECT_TRUE(server_.Call(channel, {"Bearer good"}).status.ok());
  server_.WriteAccess("tenants:\n  lighting:\n    credentials:\n      - " + TokenLine("new") + "\n");
  ASSERT_TRUE(server_.access().Reload().ok());
  EXPECT_EQ(server_.Call(channel, {"Bearer good"}).reason, "CREDENTIALS_INVALID");
  EXPECT_TRUE(server_.Call(channel, {"Bearer new"}).status.ok());
}

TEST_F(CredentialsTest, ATokenExpiresWhileAConnectionIsOpen) {
  const std::string end = absl::FormatTime(absl::RFC3339_sec, absl::Now() + absl::Hours(1), absl::UTCTimeZone());
  server_.WriteAccess("tenants:\n  a:\n    credentials:\n      - " + TokenLine("t") + "\n        expires: " + end +
                      "\n");
  server_.Start();
  const auto channel = server_.TcpChannel({});
  EXPECT_TRUE(server_.Call(channel, {"Bearer t"}).status.ok());
  server_.Advance(absl::Hours(1));
  EXPECT_EQ(server_.Call(channel, {"Bearer t"}).reason, "CREDENTIALS_EXPIRED");
}

TEST_F(CredentialsTest, RightsAreAskedForBeforeAnythingIsDone) {
  server_.WriteAccess(Access());
  server_.Start();
  const auto stub = v1::Planish::NewStub(server_.TcpChannel({}));
  grpc::ClientContext context;
  context.AddMetadata("authorization", "Bearer watcher");
  v1::JobEstimate estimate;
  const grpc::Status status = stub->EstimateJob(&context, v1::EstimateJobRequest(), &estimate);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(InfoOf(status).reason(), "RIGHT_MISSING");
  EXPECT_EQ(InfoOf(status).metadata().at("right"), "submit");
}

TEST_F(CredentialsTest, OwnUserOnAUnixSocket) {
  server_.Start();
  const CallOutcome outcome = server_.Call(server_.UnixChannel());
  ASSERT_TRUE(outcome.status.ok()) << outcome.status.error_message();
  EXPECT_EQ(outcome.caller.tenant, kDefaultTenant);
  EXPECT_EQ(outcome.caller.credential, "user " + std::to_string(geteuid()));
}

TEST_F(CredentialsTest, UsersOfTheAccessFile) {
  server_.WriteAccess(Access("      - user: " + std::to_string(geteuid()) + "\n        rights: [jobs, admin]\n"));
  server_.Start();
  const CallOutcome user = server_.Call(server_.UnixChannel());
  ASSERT_TRUE(user.status.ok()) << user.status.error_message();
  EXPECT_EQ(user.caller.tenant, "lighting");
  EXPECT_TRUE(user.caller.rights.admin);
  EXPECT_FALSE(user.caller.rights.submit);
  // A token says more than a user, and a wrong one is not helped by it.
  EXPECT_EQ(server_.Call(server_.UnixChannel(), {"Bearer good"}).caller.credential, "token farm");
  EXPECT_EQ(server_.Call(server_.UnixChannel(), {"Bearer bad"}).reason, "CREDENTIALS_INVALID");
  server_.WriteAccess(Access());
  ASSERT_TRUE(server_.access().Reload().ok());
  EXPECT_EQ(server_.Call(server_.UnixChannel()).reason, "CREDENTIALS_MISSING");
}

TEST_F(CredentialsTest, AnotherUserOnAUnixSocket) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can connect as another user";
  chmod(server_.dir().Path("").c_str(), 0755);
  server_.Start();
  const auto channel = ChannelOf(kNobody);
  const CallOutcome other = server_.Call(channel);
  EXPECT_EQ(other.status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(other.reason, "CREDENTIALS_INVALID");
  EXPECT_THAT(other.status.error_message(), HasSubstr("not user 65534"));
  EXPECT_TRUE(server_.Call(server_.UnixChannel()).status.ok()) << "root, beside it";
  EXPECT_EQ(server_.Call(channel).reason, "CREDENTIALS_INVALID");
}

TEST_F(CredentialsTest, AnotherUserWhoIsInTheAccessFile) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can connect as another user";
  chmod(server_.dir().Path("").c_str(), 0755);
  server_.WriteAccess(Access("  fx:\n    credentials:\n      - user: 65534\n"));
  server_.Start();
  const CallOutcome other = server_.Call(ChannelOf(kNobody));
  ASSERT_TRUE(other.status.ok()) << other.status.error_message();
  EXPECT_EQ(other.caller.tenant, "fx");
  EXPECT_EQ(server_.Call(server_.UnixChannel()).reason, "CREDENTIALS_MISSING") << "root is not in the file";
}

// Numbers of descriptors come back as soon as they are closed.
TEST(PeerUsers, ANumberIsNeverAnotherUsers) {
  PeerUsers peers;
  const int first = peers.AddAs(open("/dev/null", O_RDONLY | O_CLOEXEC), 1);
  ASSERT_GE(first, 0);
  EXPECT_EQ(peers.Find("fd:" + std::to_string(first)), 1u);
  close(first);
  const int second = open("/dev/null", O_RDONLY | O_CLOEXEC);
  ASSERT_EQ(second, first) << "the system gave the lowest number, as POSIX says";
  const int other = peers.AddAs(second, 2);
  EXPECT_NE(other, first);
  EXPECT_EQ(peers.Find("fd:" + std::to_string(first)), 1u) << "a late call of the first user";
  EXPECT_EQ(peers.Find("fd:" + std::to_string(other)), 2u);
  EXPECT_EQ(fcntl(first, F_GETFD), -1) << "the number of the first is free again, for the first user only";
  const int again = peers.AddAs(open("/dev/null", O_RDONLY | O_CLOEXEC), 1);
  EXPECT_EQ(again, first);
  close(other);
  close(again);
  EXPECT_FALSE(peers.Find("ipv4:127.0.0.1:99"));
  EXPECT_FALSE(peers.Find("fd:77777"));
  EXPECT_FALSE(peers.Find("fd:"));
}

TEST(PeerUsers, NobodyTakesAllNumbers) {
  PeerUsers peers(2);
  const auto connect = [&peers](std::uint32_t uid) {
    return peers.AddAs(open("/dev/null", O_RDONLY | O_CLOEXEC), uid);
  };
  const int first = connect(1), second = connect(1);
  ASSERT_GE(first, 0);
  ASSERT_GE(second, 0);
  EXPECT_EQ(connect(1), -1);
  const int other = connect(2);
  EXPECT_GE(other, 0);
  close(second);
  EXPECT_EQ(connect(1), second) << "its own numbers stay good";
  for (const int fd : {first, second, other}) close(fd);
}

}  // namespace
}  // namespace planish
