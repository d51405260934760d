// A planishd whose disk is full, or whose data directory is taken away, copied and put back.
#include <sys/mount.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <regex>
#include <sstream>

#include "absl/status/status.h"
#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"
#include "planish/v1/planish.grpc.pb.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/http_get.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// A planishd with a data directory and a metrics port.
class DataServer {
 public:
  explicit DataServer(std::string directory, std::vector<std::string> flags = {})
      : directory_(std::move(directory)), flags_(std::move(flags)) {}

  // False if it ended instead.
  bool Start() {
    std::vector<std::string> flags = {"--listen=unix:" + sockets_.Path("s"),
                                      "--metrics-listen=127.0.0.1:0",
                                      "--workers=1",
                                      "--threads=1",
                                      "--grace=0",
                                      "--data-dir=" + directory_};
    flags.insert(flags.end(), flags_.begin(), flags_.end());
    daemon_ = std::make_unique<Daemon>(std::move(flags), true);
    if (!daemon_->WaitReady()) return false;
    const std::string said = "metrics and probes at ";
    const std::string log = daemon_->ReadUntil(said);
    const std::size_t at = log.find(said) + said.size();
    http_ = log.substr(at, log.find('\n', at) - at);
    stub_ = v1::Planish::NewStub(grpc::CreateChannel("unix:" + sockets_.Path("s"), grpc::InsecureChannelCredentials()));
    return true;
  }
  int Terminate() {
    daemon_->Signal(SIGTERM);
    return daemon_->Wait();
  }
  void Kill() {
    daemon_->Signal(SIGKILL);
    daemon_->Wait();
  }
  std::string Log() const { return daemon_->Output(); }

  HttpReply Get(const std::string& path) const { return HttpGet(http_, path); }
  bool WaitForReady(int status) const {
    return WaitUntil([&] { return Get("/readyz").status == status; });
  }

  absl::Status Create(const v1::CreateJobRequest& request, std::string* name) {
    grpc::ClientContext context;
    v1::Job job;
    const grpc::Status status = stub_->CreateJob(&context, request, &job);
    *name = job.name();
    return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
  }
  std::string Create(const v1::CreateJobRequest& request) {
    std::string name;
    const absl::Status status = Create(request, &name);
    EXPECT_TRUE(status.ok()) << status;
    return name;
  }
  v1::Job GetJob(const std::string& name) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(name);
    v1::Job job;
    EXPECT_TRUE(stub_->GetJob(&context, request, &job).ok());
    return job;
  }
  bool WaitForState(const std::string& name, v1::JobState state) {
    return WaitUntil([&] { return GetJob(name).state() == state; }, 60);
  }
  grpc::Status Cancel(const std::string& name) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::Job job;
    return stub_->CancelJob(&context, request, &job);
  }
  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_name(name);
    google::protobuf::Empty nothing;
    return stub_->DeleteJob(&context, request, &nothing);
  }
  std::string Uv(const std::string& name) {
    grpc::ClientContext context;
    v1::ReadResultRequest request;
    request.set_name(name);
    v1::ReadResultResponse result;
    const grpc::Status status = stub_->ReadResult(&context, request, &result);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return result.data();
  }

 private:
  const TempDir sockets_;
  const std::string directory_;
  const std::vector<std::string> flags_;
  std::unique_ptr<Daemon> daemon_;
  std::string http_;
  std::unique_ptr<v1::Planish::Stub> stub_;
};

// No two seeds are the same mesh.
v1::CreateJobRequest JobOf(int n, int seed = 0) {
  Mesh mesh = Bump(n);
  mesh.positions[0][2] += 1e-3 * seed;
  v1::CreateJobRequest request;
  request.mutable_spec()->set_draco(*EncodeDraco(mesh));
  request.mutable_spec()->mutable_options()->set_seams(v1::SEAMS_NONE);  // the fastest
  return request;
}

// Minutes of work.
v1::CreateJobRequest SlowJob() {
  v1::CreateJobRequest request = JobOf(250);
  request.mutable_spec()->mutable_options()->set_solver(v1::SOLVER_MINRES);
  request.mutable_spec()->mutable_options()->set_system(v1::SYSTEM_FULL);
  request.mutable_spec()->mutable_options()->set_preconditioner(v1::PRECONDITIONER_NONE);
  return request;
}

class SmallDisk : public ::testing::Test {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "only root can mount a small disk";
    fs::create_directory(disk_);
    ASSERT_EQ(mount("none", disk_.c_str(), "tmpfs", 0, "size=24m"), 0) << std::strerror(errno);
    mounted_ = true;
  }
  void TearDown() override {
    if (mounted_) umount2(disk_.c_str(), MNT_DETACH);
  }

  std::int64_t Free() const {
    struct statvfs status = {};
    statvfs(disk_.c_str(), &status);
    return static_cast<std::int64_t>(status.f_bavail) * static_cast<std::int64_t>(status.f_frsize);
  }
  // As somebody else would, to the last byte.
  void Fill() const {
    std::ofstream filler(disk_ + "/filler", std::ios::binary | std::ios::app);
    filler.rdbuf()->pubsetbuf(nullptr, 0);
    for (const std::string block(4096, 'x'); filler.write(block.data(), 4096).flush().good();) {
    }
    EXPECT_EQ(Free(), 0);
  }

  const TempDir dir_;
  const std::string disk_ = dir_.Path("disk");
  bool mounted_ = false;
};

TEST_F(SmallDisk, FullOfSomethingElseMeshesAreRefusedAndDeletingWorks) {
  DataServer server(disk_ + "/data");
  ASSERT_TRUE(server.Start());
  std::vector<std::string> ended;
  for (int i = 0; i < 8; ++i) ended.push_back(server.Create(JobOf(20, i)));
  for (const std::string& job : ended) ASSERT_TRUE(server.WaitForState(job, v1::JOB_STATE_SUCCEEDED));
  const std::string slow = server.Create(SlowJob());
  ASSERT_TRUE(server.WaitForState(slow, v1::JOB_STATE_RUNNING));
  std::vector<std::string> waiting;
  for (int i = 0; i < 8; ++i) waiting.push_back(server.Create(JobOf(21, i)));

  Fill();
  EXPECT_TRUE(server.WaitForReady(503));
  EXPECT_THAT(server.Get("/readyz").body, HasSubstr(disk_ + "/data"));
  EXPECT_EQ(server.Get("/livez").status, 200);
  std::string name;
  const absl::Status refused = server.Create(JobOf(22), &name);
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("disk is nearly full"));

  for (int i = 0; i < 4; ++i) {
    const grpc::Status deleted = server.Delete(ended[static_cast<std::size_t>(i)]);
    EXPECT_TRUE(deleted.ok()) << deleted.error_message();
    const grpc::Status cancelled = server.Cancel(waiting[static_cast<std::size_t>(i)]);
    EXPECT_TRUE(cancelled.ok()) << cancelled.error_message();
    EXPECT_EQ(server.GetJob(waiting[static_cast<std::size_t>(i)]).state(), v1::JOB_STATE_CANCELLED);
  }

  // A restart in order, and one that is none.
  Fill();
  EXPECT_EQ(server.Terminate(), 0) << server.Log();
  Fill();
  ASSERT_TRUE(server.Start()) << server.Log();
  EXPECT_EQ(server.GetJob(ended[4]).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(server.GetJob(waiting[0]).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(server.GetJob(waiting[4]).state(), v1::JOB_STATE_QUEUED);
  EXPECT_TRUE(server.Cancel(waiting[4]).ok());
  server.Kill();
  Fill();
  ASSERT_TRUE(server.Start()) << server.Log();
  EXPECT_TRUE(server.Delete(ended[4]).ok());
  EXPECT_EQ(server.GetJob(waiting[5]).state(), v1::JOB_STATE_QUEUED) << "its result would have no room";
  // Not earlier: without the mesh of this job there is room for a result.
  EXPECT_TRUE(server.Cancel(slow).ok());
  EXPECT_TRUE(server.WaitForState(slow, v1::JOB_STATE_CANCELLED));

  // By itself, as soon as there is room.
  fs::remove(disk_ + "/filler");
  EXPECT_TRUE(server.WaitForReady(200)) << server.Get("/readyz").body;
  EXPECT_TRUE(server.WaitForState(waiting[5], v1::JOB_STATE_SUCCEEDED));
  EXPECT_TRUE(server.WaitForState(server.Create(JobOf(22)), v1::JOB_STATE_SUCCEEDED));
  EXPECT_TRUE(WaitUntil([&] { return fs::file_size(disk_ + "/data/reserve") == (24 << 20) / 32; }));
}

// What is accepted has room to end.
TEST_F(SmallDisk, FullOfMeshesTheHeadroomIsForResults) {
  DataServer server(disk_ + "/data", {"--queue=1000"});
  ASSERT_TRUE(server.Start());
  const std::string slow = server.Create(SlowJob());
  std::vector<std::string> accepted;
  absl::Status status;
  while (status.ok() && accepted.size() < 200) {
    std::string name;
    status = server.Create(JobOf(100, static_cast<int>(accepted.size())), &name);
    if (status.ok()) accepted.push_back(name);
  }
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_GT(accepted.size(), 10u);
  EXPECT_GT(Free(), 2 << 20) << "the headroom is 3 MiB";
  ASSERT_TRUE(server.Cancel(slow).ok());
  for (const std::string& job : accepted) {
    ASSERT_TRUE(WaitUntil([&] { return server.GetJob(job).has_end_time(); }, 60));
    const v1::JobState state = server.GetJob(job).state();
    EXPECT_TRUE(state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_EXPIRED) << server.GetJob(job).DebugString();
  }
}

// Small meshes and results are in the database: what is deleted there is free on the disk.
TEST(DataDirectoryTest, DeletedRowsGiveTheirRoomBack) {
  const TempDir dir;
  DataServer server(dir.Path("data"), {"--queue=100"});
  ASSERT_TRUE(server.Start());
  std::vector<std::string> jobs;
  for (int i = 0; i < 80; ++i) jobs.push_back(server.Create(JobOf(70, i)));
  for (const std::string& job : jobs) ASSERT_TRUE(server.WaitForState(job, v1::JOB_STATE_SUCCEEDED));
  const auto size = [&] { return fs::file_size(dir.Path("data/jobs.sqlite")); };
  ASSERT_TRUE(WaitUntil([&] { return size() > 7 << 20; })) << size();
  for (const std::string& job : jobs) EXPECT_TRUE(server.Delete(job).ok());
  EXPECT_TRUE(WaitUntil([&] { return size() < 6 << 20; })) << size();
}

TEST(DataDirectoryTest, ReplacedUnderARunningServerItIsNotReadyForGood) {
  const TempDir dir;
  const std::string data = dir.Path("data"), old = dir.Path("old");
  DataServer server(data);
  ASSERT_TRUE(server.Start());
  ASSERT_TRUE(server.WaitForState(server.Create(JobOf(8)), v1::JOB_STATE_SUCCEEDED));
  EXPECT_TRUE(server.WaitForReady(200));
  fs::rename(data, old);
  fs::copy(old, data, fs::copy_options::recursive);
  EXPECT_TRUE(server.WaitForReady(503));
  EXPECT_THAT(server.Get("/readyz").body, HasSubstr("removed or replaced"));
  EXPECT_EQ(server.Get("/livez").status, 200);
  std::string name;
  EXPECT_EQ(server.Create(JobOf(9), &name).code(), absl::StatusCode::kUnavailable);
  // Not removed: the server may be making a file in it.
  fs::rename(data, dir.Path("copy"));
  fs::rename(old, data);
  EXPECT_EQ(server.Create(JobOf(10), &name).code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(server.Get("/readyz").status, 503) << "what was written meanwhile is in another one";
}

// The indented lines under a heading of deploy/OPERATION.md, with these paths in place of its own.
std::string CommandsOf(const std::string& heading, const std::string& first_word, const std::string& data,
                       const std::string& backup) {
  const std::string text = ReadFile(PLANISH_SOURCE_TREE "/deploy/OPERATION.md");
  std::string commands;
  std::istringstream lines(text.substr(text.find(heading)));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("    ")) commands += line.substr(4) + "\n";
    if (!line.starts_with("    ") && commands.starts_with(first_word)) break;
    if (!line.starts_with("    ")) commands.clear();
  }
  commands = std::regex_replace(commands, std::regex("/var/lib/planish"), data);
  return std::regex_replace(commands, std::regex("/backup"), backup);
}

TEST(DataDirectoryTest, BackedUpAndRestoredAsThePageOnOperationSays) {
  const TempDir dir;
  const std::string data = dir.Path("data"), backup = dir.Path("backup"), restored = dir.Path("restored");
  fs::create_directory(backup);
  std::string small, large, waiting, small_uv, large_uv;
  {
    DataServer server(data);
    ASSERT_TRUE(server.Start());
    small = server.Create(JobOf(8));
    large = server.Create(JobOf(120));  // its UV are a file
    ASSERT_TRUE(server.WaitForState(large, v1::JOB_STATE_SUCCEEDED));
    ASSERT_FALSE(fs::is_empty(data + "/blobs"));
    small_uv = server.Uv(small);
    large_uv = server.Uv(large);
    const std::string slow = server.Create(SlowJob());
    waiting = server.Create(JobOf(9));
    const Outcome made = RunShell("set -e\n" + CommandsOf("## Backup", "sqlite3", data, backup));
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_TRUE(server.Cancel(slow).ok());
    EXPECT_TRUE(server.WaitForState(waiting, v1::JOB_STATE_SUCCEEDED)) << "the server goes on meanwhile";
    server.Kill();
  }
  fs::remove_all(data);
  const Outcome put = RunShell("set -e\n" + CommandsOf("To restore", "mkdir", restored, backup));
  ASSERT_EQ(put.exit_code, 0) << put.err;
  DataServer server(restored);
  ASSERT_TRUE(server.Start()) << server.Log();
  EXPECT_EQ(server.Uv(small), small_uv);
  EXPECT_EQ(server.Uv(large), large_uv);
  EXPECT_NE(server.GetJob(waiting).state(), v1::JOB_STATE_FAILED) << "it waited when the backup was made";
  std::string name;
  EXPECT_TRUE(server.Create(JobOf(10), &name).ok());
}

}  // namespace
}  // namespace planish
