// Configuration, logs, notifications and the operator's calls of the whole program.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>

#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "planish/admin/v1/admin.grpc.pb.h"
#include "planish/v1/planish.grpc.pb.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// The service manager's end of NOTIFY_SOCKET.
class NotifySocket {
 public:
  // Puts its address, that of a socket file `path`, into the environment: processes that start from now on notify it.
  explicit NotifySocket(const std::string& path);
  ~NotifySocket();
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  // The next datagram; nothing if none comes within a minute.
  std::optional<std::string> Next();

  // Waits for one with this line.
  bool WaitFor(const std::string& line);

 private:
  int socket_;
};

NotifySocket::NotifySocket(const std::string& path) : socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    throw std::runtime_error("bind");
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
}

NotifySocket::~NotifySocket() {
  unsetenv("NOTIFY_SOCKET");
  close(socket_);
}

std::optional<std::string> NotifySocket::Next() {
  constexpr int kPatienceMs = 60'000;
  pollfd wait = {socket_, POLLIN, 0};
  if (poll(&wait, 1, kPatienceMs) <= 0) return std::nullopt;
  std::array<char, 4096> buffer;
  const ssize_t length = recv(socket_, buffer.data(), buffer.size(), 0);
  return std::string(buffer.data(), length > 0 ? static_cast<std::size_t>(length) : 0);
}

bool NotifySocket::WaitFor(const std::string& line) {
  while (const std::optional<std::string> text = Next()) {
    if (("\n" + *text + "\n").find("\n" + line + "\n") != std::string::npos) return true;
  }
  return false;
}

class ConfigTest : public ::testing::Test {
 protected:
  ~ConfigTest() override {
    for (const char* name : {"PLANISHD_QUEUE", "PLANISHD_CONFIG", "PLANISHD_QEUE"}) unsetenv(name);
  }

  std::string File() const { return dir_.Path("planishd.yaml"); }
  void Write(const std::string& text) const { PutFile(File(), text); }

  // What a run that does not serve says, and its exit code.
  struct Said {
    int code = 0;
    std::string text;
  };
  static Said Run(const std::vector<std::string>& flags) {
    Daemon daemon(flags, false);
    const int code = daemon.Wait();
    return {code, daemon.Output()};
  }

  // Listens on Address() and reads File().
  std::unique_ptr<Daemon> Start(std::vector<std::string> flags = {}) {
    flags.push_back("--listen=" + Address());
    flags.push_back("--config=" + File());
    flags.push_back("--workers=1");
    auto daemon = std::make_unique<Daemon>(std::move(flags), true);
    EXPECT_TRUE(daemon->WaitReady());
    channel_ = grpc::CreateChannel(Address(), grpc::InsecureChannelCredentials());
    planish_ = v1::Planish::NewStub(channel_);
    admin_ = admin::v1::Admin::NewStub(channel_);
    return daemon;
  }
  std::string Address() const { return "unix:" + dir_.Path("s"); }

  int QueueCapacity() {
    grpc::ClientContext context;
    v1::Capabilities capabilities;
    EXPECT_TRUE(planish_->GetCapabilities(&context, {}, &capabilities).ok());
    return capabilities.queue_capacity();
  }

  grpc::Status CreateJob() {
    v1::CreateJobRequest request;
    request.mutable_spec()->set_draco(*EncodeDraco(Bump(8)));
    (*request.mutable_spec()->mutable_labels())["file"] = "mine";
    grpc::ClientContext context;
    v1::Job job;
    return planish_->CreateJob(&context, request, &job);
  }

  // The same with a label that is no text: libraries of the server have something to say about it.
  grpc::StatusCode CreateJobWithBadBytes() {
    v1::CreateJobRequest request;
    (*request.mutable_spec()->mutable_labels())["file"] = "XXXX";
    std::string bytes = request.SerializeAsString();
    bytes.replace(bytes.find("XXXX"), 4, "\xff\xfe\xff\xfe");
    const grpc::Slice slice(bytes);
    const grpc::ByteBuffer message(&slice, 1);
    grpc::ByteBuffer answer;
    grpc::ClientContext context;
    std::promise<grpc::StatusCode> code;
    grpc::GenericStub(channel_).UnaryCall(&context, "/planish.v1.Planish/CreateJob", grpc::StubOptions(), &message,
                                          &answer,
                                          [&code](const grpc::Status& status) { code.set_value(status.error_code()); });
    return code.get_future().get();
  }

  template <class Request, class Response>
  grpc::Status Ask(grpc::Status (admin::v1::Admin::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                   Response* response) {
    grpc::ClientContext context;
    return (admin_.get()->*method)(&context, Request(), response);
  }
  admin::v1::Stats Stats() {
    admin::v1::Stats stats;
    EXPECT_TRUE(Ask(&admin::v1::Admin::Stub::GetStats, &stats).ok());
    return stats;
  }

  TempDir dir_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Planish::Stub> planish_;
  std::unique_ptr<admin::v1::Admin::Stub> admin_;
};

TEST_F(ConfigTest, MetricsForOtherMachinesAreWarnedOf) {
  for (const std::string address : {"0.0.0.0:9741", "[::]:9741", "10.1.2.3:9741"}) {
    const Said said = Run({"--check-config", "--metrics-listen=" + address});
    EXPECT_EQ(said.code, 0);
    EXPECT_THAT(said.text, HasSubstr("--metrics-listen=" + address + " shows the names of tenants")) << said.text;
  }
  EXPECT_EQ(Run({"--check-config", "--metrics-listen=127.0.0.1:9741"}).text, "ok\n");
}

TEST_F(ConfigTest, PrintsWhatIsInEffectAsAFileThatGivesTheSame) {
  Write("queue: 5\ngrace: 1.5\nlisten: [127.0.0.1:0]\nsandbox: off\n");
  setenv("PLANISHD_QUEUE", "6", 1);
  const Said said = Run({"--config=" + File(), "--retain-records-mb=7", "--print-config"});
  EXPECT_EQ(said.code, 0);
  EXPECT_THAT(said.text, HasSubstr("queue: 6  # environment\n"));
  EXPECT_THAT(said.text, HasSubstr("grace: 1.5  # " + File() + ":2\n"));
  EXPECT_THAT(said.text, HasSubstr("retain-records-mb: 7  # flag\n"));
  EXPECT_THAT(said.text, HasSubstr("sandbox: off  # " + File() + ":4\n"));
  EXPECT_THAT(said.text, HasSubstr("isolation: process  # default\n"));
  unsetenv("PLANISHD_QUEUE");
  Write(said.text);
  setenv("PLANISHD_CONFIG", File().c_str(), 1);
  const Said again = Run({"--print-config"});
  EXPECT_THAT(again.text, HasSubstr("queue: 6  # " + File()));
  EXPECT_THAT(again.text, HasSubstr("retain-records-mb: 7  # " + File()));
  EXPECT_THAT(again.text, Not(HasSubstr("# default"))) << "all of them come from the file now";
}

TEST_F(ConfigTest, CheckSaysOkOrAllThatIsWrong) {
  Write("queue: 5\n");
  setenv("PLANISHD_QEUE", "6", 1);
  const Said fine = Run({"--config=" + File(), "--check-config"});
  EXPECT_EQ(fine.code, 0);
  EXPECT_THAT(fine.text, HasSubstr("did you mean PLANISHD_QUEUE?"));
  EXPECT_THAT(fine.text, HasSubstr("ok\n"));
  Write("quue: 5\nlisten:\n- 127.0.0.1:0\n- nonsense\nlog-level: loud\n");
  for (const char* const flag : {"--check-config", "--grace=1"}) {
    const Said wrong = Run({"--config=" + File(), flag});
    EXPECT_EQ(wrong.code, 2);
    EXPECT_THAT(wrong.text,
                HasSubstr("planishd: " + File() + ":1: quue: there is no such setting; did you mean queue?"));
    EXPECT_THAT(wrong.text, HasSubstr("planishd: " + File() + ":4: listen: nonsense"));
    EXPECT_THAT(wrong.text, HasSubstr("planishd: " + File() + ":5: log-level: loud is not one of debug, info"));
  }
}

TEST_F(ConfigTest, NanIsNoNumber) {
  for (const std::string flag : {"--grace", "--reattach-grace", "--lease", "--retain-hours", "--job-hours"}) {
    for (const std::string nan : {"nan", "-NaN"}) {
      const Said said = Run({flag + "=" + nan, "--check-config"});
      EXPECT_EQ(said.code, 2) << flag;
      EXPECT_THAT(said.text, HasSubstr(nan + " is not a number")) << flag;
    }
  }
}

TEST_F(ConfigTest, SighupPutsInForceWhatCanChange) {
  NotifySocket manager(dir_.Path("n"));
  Write("queue: 5\nmax-mesh-mb: 10\n");
  const auto daemon = Start();
  EXPECT_TRUE(manager.WaitFor("READY=1"));
  EXPECT_EQ(QueueCapacity(), 5);
  Write("queue: 9\nmax-mesh-mb: 11\nlog-format: json\n");
  daemon->Signal(SIGHUP);
  const std::optional<std::string> reloading = manager.Next();
  ASSERT_TRUE(reloading.has_value());
  EXPECT_THAT(*reloading, ::testing::MatchesRegex("RELOADING=1\nMONOTONIC_USEC=[0-9]+"));
  EXPECT_TRUE(manager.WaitFor("READY=1"));
  EXPECT_EQ(QueueCapacity(), 9);
  admin::v1::Config config;
  ASSERT_TRUE(Ask(&admin::v1::Admin::Stub::GetConfig, &config).ok());
  EXPECT_THAT(config.yaml(), HasSubstr("queue: 9  # " + File() + ":1\n"));
  EXPECT_THAT(config.yaml(), HasSubstr("max-mesh-mb: 10  # ")) << "what the server still runs with";
  EXPECT_GT(config.load_time().seconds(), 0);

  Write("queue: 3\nretain-records-mb: none\n");
  daemon->Signal(SIGHUP);
  EXPECT_TRUE(manager.WaitFor("READY=1"));
  EXPECT_EQ(QueueCapacity(), 9) << "all or nothing";

  daemon->Signal(SIGTERM);
  EXPECT_TRUE(manager.WaitFor("STOPPING=1"));
  EXPECT_EQ(daemon->Wait(), 0);
  const std::string log = daemon->Output();
  EXPECT_THAT(log, HasSubstr("queue changed from 5 to 9"));
  EXPECT_THAT(log, HasSubstr("max-mesh-mb changed from 10 to 11: takes effect after a restart"));
  EXPECT_THAT(log, HasSubstr(R"("level":"error","message":"not reloaded: )" + File() + ":2: retain-records-mb: "));
}

TEST_F(ConfigTest, JsonLogsParseLineByLine) {
  Write("log-format: json\nlog-level: debug\n");
  const auto daemon = Start();
  ASSERT_TRUE(CreateJob().ok());
  EXPECT_NE(CreateJobWithBadBytes(), grpc::StatusCode::OK);
  for (admin::v1::Stats now = Stats(); now.running() + now.queued() > 0;) now = Stats();
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
  EXPECT_THAT(daemon->Output(), HasSubstr("\"source\":\"protobuf\""));
  std::istringstream lines(daemon->Output());
  std::set<std::string> states;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    EXPECT_TRUE(json.contains("time") && json.contains("level") && json.contains("message")) << line;
    if (json.contains("job")) states.insert(json["message"]);
  }
  EXPECT_THAT(states, ::testing::IsSupersetOf({"QUEUED", "RUNNING", "SUCCEEDED"}));
}

TEST_F(ConfigTest, ARefusalToStartIsAJsonLineToo) {
  Write("log-format: json\n");
  const Said said = Run({"--config=" + File(), "--listen=unix:" + dir_.Path("no/where")});
  EXPECT_EQ(said.code, 2);
  const nlohmann::json json = nlohmann::json::parse(said.text, nullptr, false);
  ASSERT_TRUE(json.is_object()) << said.text;
  EXPECT_EQ(json["level"], "error");
}

TEST_F(ConfigTest, DrainRefusesNewJobsUntilUndrain) {
  Write("");
  NotifySocket manager(dir_.Path("n"));
  const auto daemon = Start();
  const admin::v1::Stats before = Stats();
  EXPECT_FALSE(before.draining());
  EXPECT_EQ(before.workers(), 1);
  EXPECT_GT(before.store_bytes(), 0);
  admin::v1::DrainResponse drained;
  ASSERT_TRUE(Ask(&admin::v1::Admin::Stub::Drain, &drained).ok());
  EXPECT_TRUE(manager.WaitFor("STATUS=drained by an operator: new jobs are refused"));
  EXPECT_TRUE(Stats().draining());
  EXPECT_EQ(CreateJob().error_code(), grpc::StatusCode::UNAVAILABLE);
  admin::v1::UndrainResponse undrained;
  ASSERT_TRUE(Ask(&admin::v1::Admin::Stub::Undrain, &undrained).ok());
  EXPECT_FALSE(Stats().draining());
  EXPECT_TRUE(CreateJob().ok());
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

}  // namespace
}  // namespace planish
