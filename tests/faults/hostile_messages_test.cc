// Memory that callers cost a real planishd on a TCP socket: those without credentials, and those with.
#include <sys/types.h>

#include <cstdlib>
#include <fstream>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "core/base/sanitizers.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "planish/admin/v1/admin.pb.h"
#include "planish/v1/planish.pb.h"
#include "tests/faults/raw_call.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;
constexpr std::int64_t kMostRefused = 64 * kMiB;
constexpr char kToken[] = "hostile-test-0123456789abcdef0123456789abcdef";

std::vector<std::string> AllPaths() {
  std::vector<std::string> paths = {"/grpc.health.v1.Health/Check", "/grpc.health.v1.Health/Watch",
                                    "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
                                    "/planish.v1.Planish/Nothing"};
  for (const auto* file : {v1::GetJobRequest::descriptor()->file(), admin::v1::DrainRequest::descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m) {
        paths.push_back("/" + file->service(s)->full_name() + "/" + file->service(s)->method(m)->name());
      }
    }
  }
  return paths;
}

// `piece` again and again, up to `bytes`.
grpc::Slice Repeat(const std::string& piece, std::int64_t bytes) {
  std::string text;
  text.reserve(static_cast<std::size_t>(bytes));
  while (static_cast<std::int64_t>(text.size() + piece.size()) <= bytes) text += piece;
  return grpc::Slice(text);
}

// A server with an access file, whose only token is kToken.
class HostileMessages : public ::testing::Test {
 protected:
  HostileMessages() {
    ReplaceFile(dir_.Path("access.yaml"),
                "tenants:\n  a:\n    credentials:\n      - token-sha256: " + absl::BytesToHexString(Sha256(kToken)) +
                    "\n        rights: [submit, jobs, admin]\n");
    daemon_ = std::make_unique<Daemon>(
        std::vector<std::string>{"--listen=127.0.0.1:0", "--access-file=" + dir_.Path("access.yaml"), "--workers=1",
                                 "--memory-mb=8192"},
        /*supervised=*/true);
    if (!daemon_->WaitReady()) throw std::runtime_error(daemon_->Output());
    const std::string log = daemon_->ReadUntil("listens on 127.0.0.1:");
    const std::size_t at = log.find("127.0.0.1:");
    target_ = log.substr(at, log.find_first_not_of("0123456789", at + 10) - at);
    // What the first call of a process brings along stays.
    Call("/grpc.health.v1.Health/Check", grpc::Slice(std::string()), {});
    Call("/planish.v1.Planish/GetCapabilities", grpc::Slice(std::string()), WithToken());
    idle_ = Status("VmRSS:");
  }

  static RawCallOptions WithToken(grpc_compression_algorithm compression = GRPC_COMPRESS_NONE) {
    return {60, kToken, compression};
  }

  CallEnd Call(const std::string& path, const grpc::Slice& request, const RawCallOptions& options) const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    RawCall call(grpc::CreateCustomChannel(target_, grpc::InsecureChannelCredentials(), arguments), path, request,
                 options);
    if (path.find("Watch") == std::string::npos || path.find("Health") == std::string::npos) {
      while (call.Read().has_value()) {
      }
    } else {
      call.Read();
    }
    return call.Finish();
  }

  // What the server had at most since the last Forget(), beyond what it had when idle.
  std::int64_t Peak() const { return Status("VmHWM:") - idle_; }
  void Forget() const {
    // The server may still free what the call before needed: until it has, the new peak is above what it holds.
    const auto reset = [this] {
      std::ofstream("/proc/" + std::to_string(daemon_->pid()) + "/clear_refs") << "5";
      return Status("VmHWM:") < Status("VmRSS:") + kMiB;
    };
    ASSERT_TRUE(WaitUntil(reset)) << "the kernel does not reset the peak";
  }

  // Calls methods, each of which must refuse.
  void ExpectRefused(const std::vector<std::string>& paths, const grpc::Slice& request, const RawCallOptions& options,
                     const std::string& what) {
    for (const std::string& path : paths) {
      Forget();
      const CallEnd end = Call(path, request, options);
      EXPECT_FALSE(end.ok()) << path << " " << what;
      if (!kSanitized) {
        EXPECT_LE(Peak(), kMostRefused) << path << " with " << what << ", which ended with " << end.code << " "
                                        << end.message;
      }
    }
  }

  TempDir dir_;
  std::unique_ptr<Daemon> daemon_;
  std::string target_;
  std::int64_t idle_ = 0;

  std::int64_t Status(const std::string& key) const {
    std::ifstream file("/proc/" + std::to_string(daemon_->pid()) + "/status");
    std::string word;
    while (file >> word) {
      if (word != key) continue;
      std::int64_t kib = 0;
      file >> kib;
      return kib << 10;
    }
    return 0;
  }
};

// Field 1 is a message or a string in every request that has any field: {0x0a, 0x00} is an empty one.
const std::string kEmptyEntry("\x0a\x00", 2);

TEST_F(HostileMessages, WithoutCredentials) {
  ExpectRefused(AllPaths(), Repeat(kEmptyEntry, 100 * kMiB), {}, "empty entries");
  // Field 5 of JobSpec in a first field: numbers of one byte each.
  ExpectRefused(AllPaths(), grpc::Slice("\x0a\x85\x80\x80\x19\x2a\x80\x80\x80\x19" + std::string(50 * kMiB, '\x01')),
                {}, "varints");
}

TEST_F(HostileMessages, NothingIsInflated) {
  // One of each size of messages; compressing takes a while.
  const std::vector<std::string> paths = {"/planish.v1.Planish/BatchCreateJobs", "/planish.v1.Planish/GetJob",
                                          "/planish.v1.Planish/WriteUpload", "/grpc.health.v1.Health/Check"};
  const grpc::Slice request = Repeat(kEmptyEntry, 80 * kMiB);
  for (const grpc_compression_algorithm compression : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    ExpectRefused(paths, request, {60, "", compression}, "compressed entries");
    ExpectRefused(paths, request, WithToken(compression), "compressed entries and credentials");
  }
  const CallEnd end = Call(paths[0], request, WithToken(GRPC_COMPRESS_GZIP));
  EXPECT_EQ(end.code, grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_THAT(end.message, ::testing::HasSubstr("gzip"));
}

TEST_F(HostileMessages, FromManyStrangersAtATime) {
  const grpc::Slice request = Repeat(kEmptyEntry, 40 * kMiB);
  for (const std::string path : {"/planish.v1.Planish/BatchCreateJobs", "/grpc.health.v1.Health/Check"}) {
    Forget();
    std::vector<std::future<CallEnd>> calls;
    for (int i = 0; i < 16; ++i) {
      calls.push_back(std::async(std::launch::async, [&] { return Call(path, request, {}); }));
    }
    for (auto& call : calls) EXPECT_FALSE(call.get().ok());
    if (!kSanitized) {
      EXPECT_LE(Peak(), kMostRefused) << path;
    }
  }
}

TEST_F(HostileMessages, WithCredentials) {
  for (const std::string& piece : {kEmptyEntry, std::string("\x78\x01"), std::string("\x0a\x01x")}) {
    ExpectRefused(AllPaths(), Repeat(piece, 40 * kMiB), WithToken(), absl::BytesToHexString(piece));
  }
}

TEST_F(HostileMessages, ThatAreAccepted) {
  v1::CreateJobRequest request;
  request.mutable_spec()->mutable_arrays()->set_positions(std::string(12 * 1'700'000, '\0'));
  request.mutable_spec()->mutable_arrays()->set_triangles(std::string(12 * 1'700'000, '\0'));
  const std::string bytes = request.SerializeAsString();
  Forget();
  const CallEnd end = Call("/planish.v1.Planish/CreateJob", grpc::Slice(bytes), WithToken());
  EXPECT_TRUE(end.ok()) << end.message;
  if (!kSanitized) {
    EXPECT_LE(Peak(), 6 * static_cast<std::int64_t>(bytes.size()) + 64 * kMiB);
  }
}

// gRPC would end calls at random where its memory is not enough.
TEST_F(HostileMessages, OthersAreServedMeanwhile) {
  class Upload {
   public:
    Upload(const std::string& target, const RawCallOptions& options)
        : stub_(grpc::CreateChannel(target, grpc::InsecureChannelCredentials())) {
      context_.AddMetadata("authorization", "Bearer " + options.token);
      call_ = stub_.PrepareCall(&context_, "/planish.v1.Planish/WriteUpload", &queue_);
      call_->StartCall(nullptr);
      Wait();
    }
    // Whether the server still waits for a message: how it answers the end of them.
    std::string Close() {
      call_->WritesDone(nullptr);
      Wait();
      grpc::Status status;
      call_->Finish(&status, nullptr);
      Wait();
      return status.error_message();
    }

   private:
    void Wait() {
      void* tag = nullptr;
      bool ok = false;
      queue_.Next(&tag, &ok);
    }
    grpc::GenericStub stub_;
    grpc::ClientContext context_;
    grpc::CompletionQueue queue_;
    std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  };
  std::vector<std::unique_ptr<Upload>> uploads;
  for (int i = 0; i < 10; ++i) uploads.push_back(std::make_unique<Upload>(target_, WithToken()));
  const grpc::Slice request = Repeat(kEmptyEntry, 300 * kMiB);
  for (const std::string path : {"/grpc.health.v1.Health/Check", "/planish.v1.Planish/CreateJob"}) {
    const CallEnd end = Call(path, request, {});
    EXPECT_TRUE(end.code == grpc::StatusCode::UNAUTHENTICATED || end.code == grpc::StatusCode::INVALID_ARGUMENT)
        << path << " " << end.code << " " << end.message;
  }
  for (const auto& upload : uploads) EXPECT_EQ(upload->Close(), "the call has no message");
}

}  // namespace
}  // namespace planish
