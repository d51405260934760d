// Addresses and sockets.
#include "server/rpc/rpc_server.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/service.h"
#include "tests/server/rpc/rpc_test_server.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

class RpcServerTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::unique_ptr<RpcServer>> Start(const std::vector<std::string>& addresses) {
    RpcServerOptions options;
    options.callers = callers_.get();
    for (const std::string& address : addresses) options.listen.push_back(*ParseListenAddress(address));
    services_.push_back(NewPlanishService(nullptr, nullptr, ServiceOptions(), &streams_));
    return RpcServer::Start(options, {services_.back().get()});
  }

  // A socket file that nobody listens on any more.
  void LeaveStaleSocket(const std::string& path) {
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    ASSERT_EQ(bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    close(fd);
  }

  TempDir dir_;
  StreamCounter streams_;
  std::unique_ptr<CallerSource> callers_ = NewOpenCallerSource();
  std::vector<std::unique_ptr<RpcService>> services_;
};

TEST_F(RpcServerTest, SeveralAddressesAndAFreePort) {
  const std::string path = dir_.Path("a");
  const auto server = Start({"127.0.0.1:0", "unix:" + path});
  ASSERT_TRUE(server.ok()) << server.status();
  ASSERT_EQ((*server)->addresses().size(), 2u);
  EXPECT_THAT((*server)->addresses()[0], HasSubstr("127.0.0.1:"));
  EXPECT_THAT((*server)->addresses()[0], ::testing::Not(EndsWith(":0")));
  EXPECT_EQ((*server)->addresses()[1], "unix:" + path);
  EXPECT_TRUE(std::filesystem::exists(path));
  (*server)->Shutdown(absl::Now());
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(RpcServerTest, PortInUse) {
  const auto first = Start({"127.0.0.1:0"});
  ASSERT_TRUE(first.ok());
  const auto second = Start({(*first)->addresses()[0]});
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(second.status().message(), HasSubstr((*first)->addresses()[0] + ": Address already in use"));
}

TEST_F(RpcServerTest, UnixSocketInUse) {
  const auto first = Start({"unix:" + dir_.Path("a")});
  ASSERT_TRUE(first.ok());
  const auto second = Start({"unix:" + dir_.Path("a")});
  EXPECT_THAT(second.status().message(), HasSubstr("a server is already listening"));
  EXPECT_TRUE(std::filesystem::exists(dir_.Path("a")));
}

TEST_F(RpcServerTest, StaleSocketGivesWay) {
  LeaveStaleSocket(dir_.Path("a"));
  EXPECT_TRUE(Start({"unix:" + dir_.Path("a")}).ok());
}

TEST_F(RpcServerTest, OtherFilesStay) {
  PutFile(dir_.Path("a"), "precious");
  EXPECT_THAT(Start({"unix:" + dir_.Path("a")}).status().message(), HasSubstr("not a socket"));
  EXPECT_EQ(std::filesystem::file_size(dir_.Path("a")), 8u);
}

TEST_F(RpcServerTest, DirectoryMissing) {
  EXPECT_THAT(Start({"unix:" + dir_.Path("no/socket")}).status().message(), HasSubstr("No such file or directory"));
}

TEST(ListenAddressTest, Forms) {
  EXPECT_EQ(ParseListenAddress("unix:/tmp/a")->unix_path, "/tmp/a");
  EXPECT_EQ(ParseListenAddress("unix:///tmp/a")->unix_path, "/tmp/a");
  EXPECT_EQ(ParseListenAddress("0.0.0.0:7741")->grpc, "0.0.0.0:7741");
  EXPECT_TRUE(ParseListenAddress("[::1]:80").ok());
  for (const char* bad : {"", "7741", "localhost", ":80", "host:", "host:99999", "host:http", "::1:80", "unix:"}) {
    EXPECT_FALSE(ParseListenAddress(bad).ok()) << bad;
  }
  EXPECT_FALSE(ParseListenAddress("unix:/" + std::string(200, 'x')).ok());
}

TEST(ListenAddressTest, Local) {
  EXPECT_TRUE(IsLocal(*ParseListenAddress("127.0.0.1:1")));
  EXPECT_TRUE(IsLocal(*ParseListenAddress("[::1]:1")));
  EXPECT_TRUE(IsLocal(*ParseListenAddress("unix:/a")));
  EXPECT_FALSE(IsLocal(*ParseListenAddress("0.0.0.0:1")));
}

TEST(GrpcStatusTest, FitsIntoMetadata) {
  EXPECT_TRUE(ToGrpcStatus(absl::OkStatus()).ok());
  const std::string umlauts = [] {
    std::string text;
    for (int i = 0; i < 3000; ++i) text += "\xc3\xa4";
    return text;
  }();
  const grpc::Status status = ToGrpcStatus(absl::NotFoundError("x" + umlauts));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_LT(status.error_details().size(), 2000u);
  EXPECT_THAT(status.error_message(), EndsWith("\xc3\xa4..."));
  EXPECT_EQ(InfoOf(status).reason(), "NOT_FOUND");
}

TEST(GrpcStatusTest, TellsNoPathsOfTheServer) {
  const auto message = [](absl::StatusCode code, const std::string& text) {
    return ToGrpcStatus(absl::Status(code, text)).error_message();
  };
  const std::string text =
      "cannot write /var/lib/planish/blobs/ab/cd.part: No space left on device (\"/var/x\", a/b, 1/2)";
  EXPECT_EQ(message(absl::StatusCode::kInternal, text),
            "cannot write (a file of the server): No space left on device (\"(a file of the server)\", a/b, 1/2)");
  EXPECT_TRUE(HidesPaths(absl::InternalError(text)));
  EXPECT_FALSE(HidesPaths(absl::InternalError("1 / 2, a/b/")));
  EXPECT_EQ(message(absl::StatusCode::kInvalidArgument, text), text) << "what the caller sent may be quoted";
}

}  // namespace
}  // namespace planish
