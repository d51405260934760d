// What is left after a loss of power, after damage on the disk, and while the machine is short of descriptors.
#include <fcntl.h>

#include <cerrno>
#include <filesystem>

#include "absl/strings/escaping.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/jobs/upload_store.h"
#include "server/store/sqlite.h"
#include "tests/server/blobs/blobs_in.h"
#include "tests/server/blobs/power_loss.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLarge = BlobRows::kMostBytes + 1;

// The system's files, some of whose calls fail.
class FailingFiles : public FileLayer {
 public:
  int Open(const std::string& path, int flags, Descriptor* file) override {
    return open_error != 0 ? -open_error : FileLayer::Open(path, flags, file);
  }
  int Sync(int fd) override { return sync_error != 0 ? -sync_error : FileLayer::Sync(fd); }

  int open_error = 0;
  int sync_error = 0;
};

// A manager, its stores in files, and uploads.
class DurabilityTest : public JobManagerTest {
 protected:
  DurabilityTest() : root_(directory_.Path("data")) {
    options_.limits.queue_capacity = 1000;
    options_.on_store_error = [this](const absl::Status& status) { errors_.emplace_back(status.message()); };
    for (const char* part : {"blobs", "uploads"}) fs::create_directories(root_ / part);
    power_ = std::make_unique<PowerLoss>(root_);
    OpenStores();
  }
  ~DurabilityTest() override { CloseStores(); }

  void CloseStores() {
    uploads_.reset();
    manager_.reset();
    blobs_.reset();
    store_.reset();
  }

  void OpenStores() {
    store_ = OpenStore(*OpenSqliteDatabase(root_ / "jobs.sqlite"));
    BlobPlaces places;
    places.store = BlobsIn(root_ / "blobs", &files_);
    places.rows = store_->rows();
    blobs_ = std::make_unique<BlobCatalog>(std::move(places), std::int64_t{1} << 30);
    blobs_->SetOnDamage([this](const absl::Status& status) { damage_.emplace_back(status.message()); });
    ASSERT_TRUE(blobs_->Open().ok());
    UploadStoreOptions uploads;
    uploads.directory = root_ / "uploads";
    uploads.clock = [this] { return now_; };
    uploads.new_id = [this] { return "u" + std::to_string(++ids_); };
    uploads_ = std::make_unique<UploadStore>(uploads, blobs_.get());
    ASSERT_TRUE(uploads_->Open().ok());
    options_.is_blob_used = [this](const BlobId& id) { return uploads_->Uses(id); };
    absl::StatusOr<std::unique_ptr<JobManager>> manager = JobManager::Open(options_, store_.get(), blobs_.get());
    ASSERT_TRUE(manager.ok()) << manager.status();
    manager_ = *std::move(manager);
  }

  // The machine loses its power and starts again with what was synced.
  void LosePower() {
    const fs::path rescued = directory_.Path("rescued" + std::to_string(++losses_));
    power_->Rescue(rescued);
    power_.reset();
    CloseStores();
    root_ = rescued;
    for (const char* part : {"blobs", "uploads"}) fs::create_directories(root_ / part);
    power_ = std::make_unique<PowerLoss>(root_);
    OpenStores();
  }

  void Reopen() {
    CloseStores();
    OpenStores();
  }

  static std::string Bytes(std::size_t size, char first) {
    std::string bytes(size, 'x');
    bytes[0] = first;
    return bytes;
  }

  std::string CreateOf(const std::string& mesh, const std::string& request_id = "") {
    JobRequest request;
    request.bytes = mesh;
    request.request_id = request_id;
    const auto accepted = manager_->Create(caller_, std::move(request));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted.ok() ? accepted->job.name() : "";
  }

  fs::path PathOf(const std::string& bytes) const {
    for (const auto& entry : fs::recursive_directory_iterator(root_ / "blobs")) {
      if (entry.is_regular_file() && ReadFile(entry.path()) == bytes) return entry.path();
    }
    ADD_FAILURE() << "there is no such file";
    return {};
  }

  std::string UvOf(const std::string& name) { return Watch(name)->uv()->ReadAll().value(); }

  const TempDir directory_;
  fs::path root_;
  int losses_ = 0;
  FailingFiles files_;
  std::unique_ptr<PowerLoss> power_;
  std::unique_ptr<UploadStore> uploads_;
  std::vector<std::string> errors_, damage_;
};

// Issue 26: nothing was ever synced.
class AfterPowerLoss : public DurabilityTest, public ::testing::WithParamInterface<std::size_t> {};

TEST_P(AfterPowerLoss, NothingThatWasAcknowledgedIsMissing) {
  const std::string mesh = Bytes(GetParam(), 'm'), uv = Bytes(GetParam(), 'u'), other = Bytes(GetParam(), 'o');
  const std::string name = CreateOf(mesh);
  LosePower();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  const std::optional<JobAssignment> assignment = TakeNext();
  EXPECT_EQ(assignment->name, name);
  EXPECT_EQ(assignment->blobs.at(0)->bytes(), mesh);
  LosePower();
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 1) << "an attempt counts that ended the machine";
  EXPECT_EQ(Take(), name);
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 2);
  const std::string waiting = CreateOf(other);
  Succeed(name, uv);
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  LosePower();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(UvOf(name), uv);
  EXPECT_EQ(Take(), waiting);
  manager_->Cancel(caller_, waiting).IgnoreError();
  LosePower();
  EXPECT_EQ(State(waiting), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(UvOf(CreateOf(mesh)), uv) << "the result is there for others";
}

TEST_P(AfterPowerLoss, CompleteUploadsAreComplete) {
  const std::string mesh = Bytes(GetParam(), 'm');
  v1::CreateUploadRequest request;
  request.set_total_bytes(static_cast<std::int64_t>(mesh.size()));
  request.set_sha256(Sha256(mesh));
  const std::string name = uploads_->Create(caller_, request)->name();
  ASSERT_TRUE(uploads_->Write(caller_, name)->Append(0, mesh).ok());
  LosePower();
  ASSERT_TRUE(uploads_->Use(caller_, name).ok());
  EXPECT_EQ(uploads_->Use(caller_, name)->mesh->bytes(), mesh);
}

// A small one is a row that is committed with the job, a large one a file.
INSTANTIATE_TEST_SUITE_P(OfBlobs, AfterPowerLoss, ::testing::Values(100, kLarge),
                         [](const auto& size) { return size.param == kLarge ? "InFiles" : "InRows"; });

// A directory that several servers use is as durable as one server's own.
TEST_F(DurabilityTest, BlobsOfASharedDirectoryOutliveALossOfPower) {
  const std::string bytes = Bytes(kLarge, 's'), file = Bytes(kLarge, 'f');
  const BlobId id = {"ann", Sha256(bytes)}, file_id = {"ann", Sha256(file)};
  const auto open = [this] {
    return DirectoryBlobStore::Make({.directory = root_ / "shared", .shared = true}).value();
  };
  ASSERT_TRUE(MakeDurableFolder(FileLayer::System(), root_ / "shared").ok());
  {
    const auto store = open();
    ASSERT_TRUE(store->Put(id, bytes).ok());
    PutFile(root_ / "upload", file);
    ASSERT_TRUE(store->PutFile(file_id, root_ / "upload").ok());
  }
  LosePower();
  const auto store = open();
  for (const auto& [kept, expected] : {std::pair(id, bytes), std::pair(file_id, file)}) {
    const absl::StatusOr<BlobPtr> loaded = store->Load(kept);
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    EXPECT_TRUE((*loaded)->bytes() == expected);
  }
}

// At most three syncs a job more than before, when there were none.
TEST_F(DurabilityTest, AJobTakesThreeSyncs) {
  constexpr int kJobs = 20;
  const int before = power_->syncs();
  for (int i = 0; i < kJobs; ++i) {
    const std::string name = CreateOf("mesh " + std::to_string(i));
    EXPECT_EQ(Take(), name);
    Succeed(name, "uv " + std::to_string(i));
    manager_->Tick();
  }
  EXPECT_EQ(power_->syncs() - before, 3 * kJobs);
}

// A large one: the mesh's file and its folder, the same of the UV, and three commits.
TEST_F(DurabilityTest, ALargeJobTakesSevenSyncs) {
  // Folders are made, and synced into theirs, once.
  for (const char* part : {"m", "u"}) {
    const std::string name = absl::BytesToHexString(Sha256(Bytes(kLarge, *part)).substr(0, 1));
    fs::create_directories(root_ / "blobs" / name);
  }
  const int before = power_->syncs();
  const std::string name = CreateOf(Bytes(kLarge, 'm'));
  EXPECT_EQ(Take(), name);
  Succeed(name, Bytes(kLarge, 'u'));
  EXPECT_EQ(power_->syncs() - before, 7);
}

// Issue 26: a mesh file cut short failed its job, and then the next upload of the good mesh.
TEST_F(DurabilityTest, DamagedMeshFailsItsJobClearlyAndIsTakenAgain) {
  const std::string mesh = Bytes(kLarge, 'm');
  const std::string name = CreateOf(mesh, "r1");
  fs::resize_file(PathOf(mesh), kLarge / 2);
  Reopen();
  EXPECT_EQ(ErrorReason(name), "MESH_LOST");
  EXPECT_THAT(damage_, ::testing::SizeIs(1));
  const std::string again = CreateOf(mesh, "r1");
  EXPECT_NE(again, name) << "the caller that has the mesh starts anew, with the same request id";
  const std::optional<JobAssignment> assignment = TakeNext();
  EXPECT_EQ(assignment->name, again);
  EXPECT_EQ(assignment->blobs.at(0)->bytes(), mesh);
}

TEST_F(DurabilityTest, DamagedMeshIsAskedForAgainByUploads) {
  const std::string mesh = Bytes(kLarge, 'm');
  v1::CreateUploadRequest request;
  request.set_total_bytes(static_cast<std::int64_t>(mesh.size()));
  request.set_sha256(Sha256(mesh));
  const std::string first = uploads_->Create(caller_, request)->name();
  ASSERT_TRUE(uploads_->Write(caller_, first)->Append(0, mesh).ok());
  std::string damaged = mesh;
  damaged[1000] = 'y';
  PutFile(PathOf(mesh), damaged);
  Reopen();
  EXPECT_EQ(Reason(uploads_->Use(caller_, first).status()), "UPLOAD_NOT_FOUND");
  const absl::StatusOr<v1::Upload> second = uploads_->Create(caller_, request);
  EXPECT_EQ(second->committed_bytes(), 0);
  ASSERT_TRUE(uploads_->Write(caller_, second->name())->Append(0, mesh).ok());
  EXPECT_EQ(uploads_->Use(caller_, second->name())->mesh->bytes(), mesh);
}

// The damage may as well be found by the caller who puts the bytes anew.
TEST_F(DurabilityTest, GoodBytesReplaceDamagedOnes) {
  const std::string bytes = Bytes(kLarge, 'm');
  ASSERT_TRUE(blobs_->Put(kDefaultTenant, bytes).ok());
  PutFile(PathOf(bytes), bytes.substr(0, 10));
  options_.is_blob_used = nullptr;
  CloseStores();
  BlobCatalog blobs({BlobsIn(root_ / "blobs")}, std::int64_t{1} << 30);
  ASSERT_TRUE(blobs.Open().ok());
  EXPECT_EQ(blobs.bytes(), 10);
  EXPECT_EQ((*blobs.Put(kDefaultTenant, bytes))->ReadAll().value(), bytes);
  EXPECT_EQ(blobs.bytes(), static_cast<std::int64_t>(bytes.size()));
}

// Issue 26: a damaged cached UV was served for ever.
TEST_F(DurabilityTest, DamagedResultIsComputedAgain) {
  const std::string mesh = Bytes(100, 'm'), uv = Bytes(kLarge, 'u');
  const std::string name = CreateOf(mesh);
  Take();
  Succeed(name, uv);
  std::string damaged = uv;
  damaged[kLarge / 2] = '?';
  PutFile(PathOf(uv), damaged);
  Reopen();
  const std::string again = CreateOf(mesh);
  EXPECT_EQ(State(again), v1::JOB_STATE_QUEUED) << "it does not get the damaged UV";
  EXPECT_EQ(Reason(manager_->Watch(caller_, name, false, true).status()), "RESULT_EXPIRED");
  EXPECT_EQ(Take(), again);
  Succeed(again, uv);
  EXPECT_EQ(UvOf(again), uv);
  EXPECT_EQ(UvOf(name), uv) << "it has the same ones";
}

TEST_F(DurabilityTest, DamagedRowsCountAsAbsent) {
  const std::string name = CreateOf("mesh");
  Take();
  Succeed(name, "uv");
  CloseStores();
  {
    absl::StatusOr<Database> database = Database::Open(root_ / "jobs.sqlite");
    ASSERT_TRUE(database->Execute("UPDATE blobs SET bytes = x'00'").ok());
  }
  OpenStores();
  EXPECT_EQ(State(CreateOf("mesh")), v1::JOB_STATE_QUEUED);
  Take();
}

// No mapping: that would have been SIGBUS.
TEST_F(DurabilityTest, AFileThatIsCutShortWhileItIsReadIsAnError) {
  const std::string uv = Bytes(kLarge, 'u');
  const std::string name = CreateOf("mesh");
  Take();
  Succeed(name, uv);
  const auto log = Watch(name);
  fs::resize_file(PathOf(uv), 5);
  std::string bytes;
  EXPECT_TRUE(log->uv()->Read(0, 5, &bytes).ok());
  EXPECT_EQ(Reason(log->uv()->Read(4096, 1, &bytes)), "BLOB_DAMAGED");
}

// Issue 26: EMFILE or ENOMEM while a mesh was opened failed the job for good as MESH_LOST.
TEST_F(DurabilityTest, JobsWaitWhileThereAreNoDescriptors) {
  const std::string mesh = Bytes(kLarge, 'm');
  const std::string name = CreateOf(mesh);
  JobAssignment assignment;
  for (const int error : {EMFILE, ENOMEM}) {
    files_.open_error = error;
    EXPECT_EQ(manager_->source()->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing);
    EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
    now_ += options_.retry_delay;
    manager_->Tick();
  }
  EXPECT_THAT(errors_, ::testing::SizeIs(2));
  files_.open_error = 0;
  EXPECT_EQ(Take(), name);
}

TEST_F(DurabilityTest, NothingIsAcceptedThatCannotBeSynced) {
  const std::string mesh = Bytes(kLarge, 'm');
  files_.sync_error = EIO;
  JobRequest request;
  request.bytes = mesh;
  EXPECT_FALSE(manager_->Create(caller_, request).ok());
  EXPECT_EQ(blobs_->bytes(), 0);
  files_.sync_error = 0;
  EXPECT_TRUE(manager_->Create(caller_, request).ok());
}

// Issue 26: a sweep over all blobs held the manager's lock. It looks at a few of them at a time.
TEST_F(DurabilityTest, ASweepTakesManySteps) {
  constexpr int kBlobs = 300;
  for (int i = 0; i < kBlobs; ++i) ASSERT_TRUE(blobs_->Put(kDefaultTenant, "unused " + std::to_string(i)).ok());
  now_ += absl::Hours(1);
  manager_->Tick();
  const std::size_t after_one = blobs_->Ids().size();
  EXPECT_LT(after_one, kBlobs);
  EXPECT_GT(after_one, kBlobs / 2);
  for (int i = 0; i < kBlobs && blobs_->bytes() > 0; ++i) manager_->Tick();
  EXPECT_EQ(blobs_->bytes(), 0);
}

}  // namespace
}  // namespace planish
