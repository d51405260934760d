#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <thread>

#include "absl/time/clock.h"
#include "core/base/error.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/link/blob.h"
#include "server/link/frame_socket.h"
#include "server/link/in_process_link.h"
#include "server/link/rpc_status.h"
#include "server/link/worker_arguments.h"
#include "tests/testing/fake_workers.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using worker::v1::ToWorker;

// ---- links

WorkerLink::Wait Receive(WorkerLink& link, worker::v1::FromWorker* message) {
  WorkerLink::Received received;
  const WorkerLink::Wait wait = link.Receive(absl::InfiniteFuture(), &received);
  *message = received.message;
  return wait;
}

TEST(InProcessLink, DeliversWhatWasSentBeforeTheWorkerHungUp) {
  const auto link = StartInProcessWorker([](ServerLink& server) {
    server.Send(ProgressMessage(1));
    server.Send(SuccessMessage("uv"), *Blob::Copy("uv"));
    server.Close();
    server.Send(ProgressMessage(2));
  });
  ASSERT_TRUE(link.ok());
  WorkerLink::Received received;
  ASSERT_EQ((*link)->Receive(absl::InfiniteFuture(), &received), WorkerLink::Wait::kMessage);
  EXPECT_TRUE(received.message.has_event());
  ASSERT_EQ((*link)->Receive(absl::InfiniteFuture(), &received), WorkerLink::Wait::kMessage);
  EXPECT_EQ(received.blob->bytes(), "uv");
  EXPECT_EQ((*link)->Receive(absl::InfiniteFuture(), &received), WorkerLink::Wait::kClosed);
  EXPECT_EQ((*link)->HowEnded().reason, "WORKER_CRASHED");
}

TEST(InProcessLink, WorkerThatThrowsClosesTheLinkAndSaysWhat) {
  const auto link = StartInProcessWorker([](ServerLink&) { throw std::runtime_error("boom"); });
  ASSERT_TRUE(link.ok());
  worker::v1::FromWorker message;
  EXPECT_EQ(Receive(**link, &message), WorkerLink::Wait::kClosed);
  EXPECT_THAT((*link)->HowEnded().message, HasSubstr("boom"));
}

TEST(InProcessLink, SaysWhenTimeIsUp) {
  const auto link = StartInProcessWorker([](ServerLink& server) { server.Receive(); });
  WorkerLink::Received received;
  EXPECT_EQ((*link)->Receive(absl::InfinitePast(), &received), WorkerLink::Wait::kTimeout);
  EXPECT_EQ((*link)->Receive(absl::Now() + absl::Milliseconds(2), &received), WorkerLink::Wait::kTimeout);
}

TEST(InProcessLink, DestructionEndsAWorkerThatWaits) {
  bool saw_the_end = false;
  {
    const auto link = StartInProcessWorker([&](ServerLink& server) {
      while (server.Receive().has_value()) {
      }
      saw_the_end = true;
    });
    ASSERT_TRUE(link.ok());
    (*link)->Send(ToWorker());
  }
  EXPECT_TRUE(saw_the_end);
}

TEST(WorkerArguments, SurviveTheCommandLine) {
  WorkerArguments arguments;
  arguments.fd = 3;
  arguments.failpoints = true;
  for (const SandboxMode mode : {SandboxMode::kAuto, SandboxMode::kRequire, SandboxMode::kOff}) {
    arguments.sandbox = mode;
    std::vector<std::string> line = ToCommandLine(arguments);
    std::vector<const char*> argv = {"planishd"};
    for (const std::string& word : line) argv.push_back(word.c_str());
    const auto parsed = ParseWorkerArguments(static_cast<int>(argv.size()), argv.data());
    ASSERT_TRUE(parsed.has_value());
    EXPECT_EQ(parsed->fd, 3);
    EXPECT_EQ(parsed->sandbox, mode);
    EXPECT_TRUE(parsed->failpoints);
  }
  const char* const server[] = {"planishd", "--workers=2"};
  EXPECT_FALSE(ParseWorkerArguments(2, server).has_value());
  EXPECT_FALSE(ParseWorkerArguments(1, server).has_value());
}

// ---- blobs

TEST(Blob, KeepsBytesThatNobodyCanChange) {
  const BlobPtr blob = *Blob::Copy("some bytes");
  EXPECT_EQ(blob->bytes(), "some bytes");
  EXPECT_EQ(pwrite(blob->descriptor(), "x", 1, 0), -1);
  EXPECT_EQ(ftruncate(blob->descriptor(), 1), -1);
  EXPECT_EQ(mmap(nullptr, 10, PROT_WRITE, MAP_SHARED, blob->descriptor(), 0), MAP_FAILED);
  EXPECT_EQ((*Blob::MapSealed(Descriptor(dup(blob->descriptor()))))->bytes(), "some bytes");
  EXPECT_EQ((*Blob::Copy(""))->bytes(), "");
}

TEST(Blob, OnlySealedMemoryIsTakenFromOthers) {
  const int memory = memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  ASSERT_EQ(write(memory, "abc", 3), 3);
  EXPECT_FALSE(Blob::MapSealed(Descriptor(dup(memory))).ok());
  ASSERT_EQ(fcntl(memory, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_WRITE), 0);
  EXPECT_FALSE(Blob::MapSealed(Descriptor(dup(memory))).ok()) << "it can still be unsealed or grow";
  EXPECT_FALSE(Blob::MapSealed(Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC))).ok());
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  EXPECT_FALSE(Blob::MapSealed(Descriptor(pipe_ends[0])).ok());
  close(pipe_ends[1]);
  EXPECT_EQ((*Blob::Map(Descriptor(memory)))->bytes(), "abc") << "a file of ours";
}

TEST(Blob, HasNoPagesUntilItIsReadAgain) {
  const BlobPtr blob = *Blob::Copy(std::string(1 << 20, 'x'));
  // Of the pages that hold the bytes: those that this process has mapped.
  const auto mapped = [&blob] {
    std::int64_t pages = 0;
    const std::size_t page = sysconf(_SC_PAGESIZE);
    const int map = open("/proc/self/pagemap", O_RDONLY | O_CLOEXEC);
    for (std::size_t at = 0; at < blob->bytes().size(); at += page) {
      std::uint64_t entry = 0;
      const std::size_t number = reinterpret_cast<std::size_t>(blob->bytes().data() + at) / page;
      EXPECT_EQ(pread(map, &entry, sizeof(entry), static_cast<off_t>(number * sizeof(entry))), 8);
      pages += static_cast<std::int64_t>(entry >> 63);
    }
    close(map);
    return pages;
  };
  const auto read = [&blob] { return std::count(blob->bytes().begin(), blob->bytes().end(), 'x'); };
  EXPECT_EQ(read(), 1 << 20);
  EXPECT_GT(mapped(), 0);
  blob->DropPages();
  EXPECT_EQ(mapped(), 0);
  EXPECT_EQ(read(), 1 << 20);
}

TEST(Blob, MoreThanThereIsRoomForIsAnError) {
  // A limit of this process: asking for more than the machine has would take all of it first.
  const auto old_handler = signal(SIGXFSZ, SIG_IGN);
  rlimit old_limit = {};
  getrlimit(RLIMIT_FSIZE, &old_limit);
  const rlimit limit = {1 << 20, old_limit.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  EXPECT_TRUE(BlobWriter::Make(1 << 20).ok());
  EXPECT_EQ(ErrorInfoOf(BlobWriter::Make((1 << 20) + 1).status()).reason, "OUT_OF_MEMORY");
  setrlimit(RLIMIT_FSIZE, &old_limit);
  signal(SIGXFSZ, old_handler);
}

// ---- frames

class Frames : public ::testing::Test {
 protected:
  Frames() {
    int ends[2];
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
    raw_ = Descriptor(ends[0]);
    socket_ = *FrameSocket::Make(Descriptor(ends[1]), {.bytes = 1000, .descriptors = 1});
  }

  // As a header and what follows it, with `descriptors` copies of stdin.
  void SendRaw(std::uint32_t length, std::uint32_t announced, const std::string& body, std::size_t descriptors) {
    const std::uint32_t header[2] = {length, announced};
    std::string bytes(reinterpret_cast<const char*>(header), sizeof(header));
    bytes += body;
    iovec part = {bytes.data(), bytes.size()};
    msghdr message = {};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    alignas(cmsghdr) char control[CMSG_SPACE(20 * sizeof(int))] = {};
    if (descriptors > 0) {
      message.msg_control = control;
      message.msg_controllen = CMSG_SPACE(descriptors * sizeof(int));
      cmsghdr* const rights = CMSG_FIRSTHDR(&message);
      rights->cmsg_level = SOL_SOCKET;
      rights->cmsg_type = SCM_RIGHTS;
      rights->cmsg_len = CMSG_LEN(descriptors * sizeof(int));
      for (std::size_t i = 0; i < descriptors; ++i) {
        std::memcpy(CMSG_DATA(rights) + i * sizeof(int), &stdin_, sizeof(int));
      }
    }
    ASSERT_EQ(sendmsg(raw_.get(), &message, 0), static_cast<ssize_t>(bytes.size()));
  }

  // What is wrong; empty if the connection was not closed.
  std::string Fault() {
    Frame frame;
    const FrameSocket::Wait wait = socket_->Receive(absl::Now() + absl::Seconds(60), &frame);
    return wait == FrameSocket::Wait::kClosed ? socket_->fault() : "";
  }

  const int stdin_ = 0;
  Descriptor raw_;
  std::unique_ptr<FrameSocket> socket_;
};

TEST_F(Frames, ArriveInPiecesOrTogether) {
  const std::uint32_t header[2] = {5, 0};
  std::string bytes(reinterpret_cast<const char*>(header), sizeof(header));
  bytes += "hello";
  Frame frame;
  for (const char byte : bytes) {
    EXPECT_EQ(socket_->Receive(absl::InfinitePast(), &frame), FrameSocket::Wait::kTimeout);
    ASSERT_EQ(write(raw_.get(), &byte, 1), 1);
  }
  EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kFrame);
  EXPECT_EQ(frame.bytes, "hello");
  SendRaw(3, 0, "one", 0);
  SendRaw(0, 0, "", 0);
  SendRaw(3, 1, "two", 1);
  for (const char* expected : {"one", "", "two"}) {
    ASSERT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kFrame);
    EXPECT_EQ(frame.bytes, expected);
  }
  EXPECT_EQ(frame.descriptors.size(), 1u);
  EXPECT_EQ(fcntl(frame.descriptors[0].get(), F_GETFD) & FD_CLOEXEC, FD_CLOEXEC);
}

TEST_F(Frames, TooLong) {
  SendRaw(1001, 0, "", 0);
  EXPECT_THAT(Fault(), HasSubstr("1001 bytes"));
  Frame frame;
  EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kClosed) << "and stays closed";
}

TEST_F(Frames, WithFewerDescriptorsThanAnnounced) {
  SendRaw(1, 1, "x", 0);
  EXPECT_THAT(Fault(), HasSubstr("announces 1 descriptors and comes with 0"));
}

TEST_F(Frames, WithDescriptorsNotAnnounced) {
  SendRaw(1, 0, "x", 1);
  EXPECT_THAT(Fault(), HasSubstr("comes with 1"));
}

TEST_F(Frames, WithMoreDescriptorsThanAllowed) {
  SendRaw(1, 2, "x", 2);
  EXPECT_THAT(Fault(), HasSubstr("1 at most"));
}

TEST_F(Frames, WithMoreDescriptorsThanCanBeTaken) {
  const Descriptor next_before(dup(0));
  SendRaw(1, 20, "x", 20);
  EXPECT_THAT(Fault(), HasSubstr("more descriptors"));
  const Descriptor next_after(dup(0));
  EXPECT_EQ(next_after.get(), next_before.get() + 1) << "none was kept";
}

TEST_F(Frames, WhoseSenderIsGoneAreDropped) {
  SendRaw(2, 0, "ok", 0);
  SendRaw(100, 0, "half", 0);
  raw_ = Descriptor();
  Frame frame;
  EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kFrame);
  EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kClosed);
  EXPECT_EQ(socket_->fault(), "");
  socket_->Send("too late", {});
}

TEST_F(Frames, SendingNeverWaitsForAReader) {
  const BlobPtr blob = *Blob::Copy("blob");
  const std::string bytes(100'000, 'x');
  for (int i = 0; i < 100; ++i) socket_->Send(bytes, {blob});  // far more than a socket holds
  auto reader = *FrameSocket::Make(std::move(raw_), {.bytes = 200'000, .descriptors = 1});
  std::thread flusher([this] {
    Frame frame;
    EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kFrame);
  });
  for (int i = 0; i < 100; ++i) {
    Frame frame;
    ASSERT_EQ(reader->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kFrame) << i;
    EXPECT_EQ(frame.bytes, bytes);
    ASSERT_EQ(frame.descriptors.size(), 1u);
    EXPECT_EQ((*Blob::MapSealed(std::move(frame.descriptors[0])))->bytes(), "blob");
  }
  reader->Send("done", {});
  flusher.join();
}

TEST_F(Frames, ReaderThatNeverReadsIsGivenUp) {
  const std::string bytes(1 << 20, 'x');
  for (std::size_t sent = 0; sent <= FrameSocket::kMaxUnsentBytes + (std::size_t{1} << 20); sent += bytes.size()) {
    socket_->Send(bytes, {});
  }
  Frame frame;
  EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kClosed);
}

TEST_F(Frames, CloseWakesTheReceiver) {
  std::thread closer([this] { socket_->Close(); });
  Frame frame;
  EXPECT_EQ(socket_->Receive(absl::InfiniteFuture(), &frame), FrameSocket::Wait::kClosed);
  closer.join();
}

// ---- errors

TEST(RpcStatus, CarriesReasonMetadataAndRetry) {
  const absl::Status status =
      WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL", "full", {{"queue_capacity", "3"}}),
                     absl::Milliseconds(1500));
  const google::rpc::Status rpc = ToRpcStatus(status);
  EXPECT_EQ(rpc.code(), 8);
  EXPECT_EQ(rpc.message(), "full");
  ASSERT_EQ(rpc.details_size(), 2);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(rpc.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "QUEUE_FULL");
  EXPECT_EQ(info.domain(), "planish");
  EXPECT_EQ(info.metadata().at("queue_capacity"), "3");
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(rpc.details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 1);
  EXPECT_EQ(retry.retry_delay().nanos(), 500'000'000);
}

TEST(RpcStatus, OkIsEmptyAndForeignErrorsGetTheirCodeAsReason) {
  EXPECT_EQ(ToRpcStatus(absl::OkStatus()).ByteSizeLong(), 0u);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(ToRpcStatus(absl::AbortedError("x")).details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "ABORTED");
}

TEST(RpcStatus, BrokenUtf8InAMessageStaysReadable) {
  const google::rpc::Status rpc = ToRpcStatus(absl::InternalError("bad \xff byte"));
  google::rpc::Status parsed;
  ASSERT_TRUE(parsed.ParseFromString(rpc.SerializeAsString()));
  EXPECT_EQ(parsed.message(), "bad \xEF\xBF\xBD byte");
}

}  // namespace
}  // namespace planish
