// Uploads at several front ends over one place: each case with two stores that know nothing of each other.
#include <functional>
#include <memory>
#include <optional>
#include <random>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/blobs/directory_blobs.h"
#include "server/blobs/s3_blobs.h"
#include "server/jobs/upload_store.h"
#include "server/store/sql_blobs.h"
#include "server/store/sql_uploads.h"
#include "tests/server/blobs/s3_server.h"
#include "tests/server/store/failing_database.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::IsEmpty;

std::string MeshBytes(std::size_t size, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

std::string UploadReason(const absl::Status& status) {
  return status.ok() ? "OK" : ErrorInfoOf(status).reason;
}

enum class BlobEngine { kDirectory, kRows, kObjects };

PostgresServer& SharedPostgres() {
  static PostgresServer server;
  return server;
}
S3Server& SharedS3() {
  static S3Server server;
  return server;
}

// A server's own objects.
struct Front {
  std::unique_ptr<SqlDatabase> database;
  std::shared_ptr<BlobStore> store;
  std::unique_ptr<BlobCatalog> blobs;
  std::unique_ptr<SqlUploads> place;
  std::unique_ptr<UploadStore> uploads;
};

class SharedUploads : public ::testing::TestWithParam<BlobEngine> {
 protected:
  void SetUp() override {
    if (GetParam() == BlobEngine::kObjects && !SharedS3().why_not().empty()) GTEST_SKIP() << SharedS3().why_not();
    static int prefixes = 0;
    prefix_ = "uploads" + std::to_string(++prefixes);
    url_ = SharedPostgres().NewDatabase();
    options_.new_id = [this] { return "u" + std::to_string(++ids_); };
    for (Front& front : fronts_) front = Start();
  }

  Front Start(Fault* fault = nullptr) {
    Front front;
    front.database = OpenPostgresDatabase({.url = url_}).value();
    if (fault != nullptr) front.database = std::make_unique<FailingDatabase>(std::move(front.database), fault);
    switch (GetParam()) {
      case BlobEngine::kDirectory:
        front.store = DirectoryBlobStore::Make({.directory = directory_.Path(), .shared = true}).value();
        break;
      case BlobEngine::kRows:
        front.store = SqlBlobStore::Make(front.database.get()).value();
        break;
      case BlobEngine::kObjects: {
        S3BlobsOptions options{.s3 = SharedS3().Options()};
        options.s3.prefix = prefix_;
        front.store = S3BlobStore::Make(options).value();
        break;
      }
    }
    front.blobs = std::make_unique<BlobCatalog>(BlobPlaces{front.store}, std::int64_t{1} << 30);
    EXPECT_TRUE(front.blobs->Open().ok());
    front.place = SqlUploads::Make(front.database.get(), front.store.get(), {.clock = [this] { return now_; }}).value();
    UploadStoreOptions options = options_;
    options.place = front.place.get();
    front.uploads = std::make_unique<UploadStore>(options, front.blobs.get());
    EXPECT_TRUE(front.uploads->Open().ok());
    return front;
  }

  UploadStore& A() { return *fronts_[0].uploads; }
  UploadStore& B() { return *fronts_[1].uploads; }

  static v1::CreateUploadRequest RequestFor(const std::string& bytes, const std::string& request_id = "") {
    v1::CreateUploadRequest request;
    request.set_total_bytes(static_cast<std::int64_t>(bytes.size()));
    request.set_sha256(Sha256(bytes));
    request.set_request_id(request_id);
    return request;
  }
  std::string CreateAt(UploadStore& store, const std::string& bytes) {
    const absl::StatusOr<v1::Upload> upload = store.Create(caller_, RequestFor(bytes));
    EXPECT_TRUE(upload.ok()) << upload.status();
    return upload.ok() ? upload->name() : "";
  }
  std::int64_t Committed(UploadStore& store, const std::string& name) {
    return store.Get(caller_, name)->committed_bytes();
  }
  void ExpectMesh(UploadStore& store, const std::string& name, const std::string& bytes) {
    const absl::StatusOr<UploadedMesh> mesh = store.Use(caller_, name);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_TRUE(mesh->mesh->bytes() == bytes);
  }

  // Blobs that are pieces of uploads.
  std::vector<BlobId> Parts() {
    std::vector<BlobId> parts;
    EXPECT_TRUE(fronts_[0].store->List([&](const BlobEntry& entry) {
      if (SqlUploads::IsPart(entry.id)) parts.push_back(entry.id);
    }).ok());
    return parts;
  }

  const Caller caller_ = {"ann", "", Rights::All(), ""};
  const TempDir directory_;
  std::string prefix_, url_;
  absl::Time now_ = absl::UnixEpoch() + absl::Hours(24);
  int ids_ = 0;
  UploadStoreOptions options_;
  Front fronts_[2];
};

INSTANTIATE_TEST_SUITE_P(Files, SharedUploads, ::testing::Values(BlobEngine::kDirectory),
                         [](const auto&) { return "Directory"; });
INSTANTIATE_TEST_SUITE_P(Postgres, SharedUploads, ::testing::Values(BlobEngine::kRows),
                         [](const auto&) { return "Rows"; });
INSTANTIATE_TEST_SUITE_P(S3, SharedUploads, ::testing::Values(BlobEngine::kObjects),
                         [](const auto&) { return "Objects"; });

TEST_P(SharedUploads, WhoIsCutOffAtOneGoesOnAtTheOther) {
  const std::string bytes = MeshBytes(2'000'000);
  const std::string name = CreateAt(A(), bytes);
  UploadWriter cut_off = *A().Write(caller_, name);
  ASSERT_EQ(cut_off.Append(0, bytes.substr(0, 700'000)), absl::OkStatus());
  ASSERT_EQ(cut_off.Append(700'000, bytes.substr(700'000, 300'000)), absl::OkStatus());

  EXPECT_EQ(Committed(B(), name), 1'000'000);
  EXPECT_EQ(UploadReason(B().Use(caller_, name).status()), "UPLOAD_INCOMPLETE");
  EXPECT_EQ(UploadReason(B().Write(caller_, name).status()), "UPLOAD_BUSY") << "nobody knows yet that A is gone";
  now_ += options_.writer_limit;
  {
    absl::StatusOr<UploadWriter> writer = B().Write(caller_, name);
    ASSERT_TRUE(writer.ok()) << writer.status();
    ASSERT_EQ(writer->Append(1'000'000, bytes.substr(1'000'000)), absl::OkStatus());
  }
  EXPECT_EQ(Committed(A(), name), 2'000'000);
  ExpectMesh(A(), name, bytes);
  ExpectMesh(B(), name, bytes);
  EXPECT_THAT(Parts(), IsEmpty()) << "the pieces are no longer needed";
  const Front third = Start();
  ExpectMesh(*third.uploads, name, bytes);
}

// The writer of A was only slow, and comes back when B has gone on.
TEST_P(SharedUploads, AWriterThatComesBackLateIsFenced) {
  const std::string bytes = MeshBytes(10'000);
  const std::string name = CreateAt(A(), bytes);
  UploadWriter late = *A().Write(caller_, name);
  ASSERT_TRUE(late.Append(0, bytes.substr(0, 1000)).ok());
  now_ += options_.writer_limit;
  UploadWriter next = *B().Write(caller_, name);
  EXPECT_EQ(UploadReason(late.Append(1000, bytes.substr(1000))), "UPLOAD_BUSY");
  EXPECT_EQ(Committed(B(), name), 1000);
  ASSERT_TRUE(next.Append(1000, bytes.substr(1000, 500)).ok());
  EXPECT_EQ(UploadReason(late.Append(1500, bytes.substr(1500, 10))), "UPLOAD_BUSY");
  late = UploadWriter();
  EXPECT_EQ(UploadReason(A().Write(caller_, name).status()), "UPLOAD_BUSY") << "its end is not that of the next one";
  ASSERT_EQ(next.Append(1500, bytes.substr(1500)), absl::OkStatus());
  ExpectMesh(A(), name, bytes);
}

// As above, but the writer is late within its append: the bytes are there, and do not count.
TEST_P(SharedUploads, AnAppendThatIsOvertakenChangesNothing) {
  const std::string bytes = MeshBytes(10'000);
  Fault fault;
  const Front slow = Start(&fault);
  const std::string name = CreateAt(A(), bytes);
  UploadWriter late = *slow.uploads->Write(caller_, name);
  std::optional<UploadWriter> next;
  int locks = 0;
  fault.before = [&](const std::string& sql) {
    // The second time that the append looks at the upload its piece is written.
    if (sql.find("FROM uploads WHERE id = ? {lock}") == std::string::npos || ++locks != 2) return;
    EXPECT_THAT(Parts(), ::testing::SizeIs(1));
    now_ += options_.writer_limit;
    next = *B().Write(caller_, name);
    EXPECT_EQ(next->Append(0, bytes.substr(0, 5000)), absl::OkStatus());
  };
  EXPECT_EQ(UploadReason(late.Append(0, bytes.substr(0, 3000))), "UPLOAD_BUSY");
  ASSERT_TRUE(next.has_value());
  EXPECT_EQ(Committed(A(), name), 5000);
  EXPECT_THAT(Parts(), ::testing::SizeIs(1)) << "the piece that came too late is gone";
  ASSERT_EQ(next->Append(5000, bytes.substr(5000)), absl::OkStatus());
  ExpectMesh(A(), name, bytes);
  EXPECT_THAT(Parts(), IsEmpty());
}

TEST_P(SharedUploads, ARequestIdStandsForOneUploadAtAll) {
  const std::string bytes = MeshBytes(1000);
  const std::string name = A().Create(caller_, RequestFor(bytes, "once"))->name();
  ASSERT_TRUE(A().Write(caller_, name)->Append(0, bytes.substr(0, 400)).ok());
  const absl::StatusOr<v1::Upload> again = B().Create(caller_, RequestFor(bytes, "once"));
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->name(), name);
  EXPECT_EQ(again->committed_bytes(), 400);
  EXPECT_EQ(UploadReason(B().Create(caller_, RequestFor(MeshBytes(1000, 2), "once")).status()), "REQUEST_ID_REUSED");
}

TEST_P(SharedUploads, BytesThatAnyServerHasNeedNotComeAgain) {
  const std::string bytes = MeshBytes(1000);
  ASSERT_TRUE(A().Write(caller_, CreateAt(A(), bytes))->Append(0, bytes).ok());
  const absl::StatusOr<v1::Upload> upload = B().Create(caller_, RequestFor(bytes));
  ASSERT_TRUE(upload.ok()) << upload.status();
  EXPECT_EQ(upload->committed_bytes(), 1000);
  EXPECT_THAT(*B().FindMissing(caller_, {Sha256(bytes)}), IsEmpty());
  ExpectMesh(B(), upload->name(), bytes);
  const Caller other = {"bob", "", Rights::All(), ""};
  EXPECT_EQ(B().Create(other, RequestFor(bytes))->committed_bytes(), 0) << "but each tenant sends its own";
  EXPECT_EQ(UploadReason(B().Get(other, upload->name()).status()), "UPLOAD_NOT_FOUND");
}

TEST_P(SharedUploads, BoundsAreThoseOfAllTogether) {
  options_.max_uploads = 3;
  for (Front& front : fronts_) front = Start();
  for (int i = 0; i < 3; ++i) CreateAt(i % 2 == 0 ? A() : B(), MeshBytes(10, static_cast<unsigned>(i)));
  EXPECT_EQ(UploadReason(A().Create(caller_, RequestFor(MeshBytes(10, 4))).status()), "QUEUE_FULL");
  EXPECT_EQ(UploadReason(B().Create(caller_, RequestFor(MeshBytes(10, 4))).status()), "QUEUE_FULL");
  EXPECT_EQ(A().Gauges().open, 3);
}

TEST_P(SharedUploads, WrongBytesVoidTheUpload) {
  const std::string name = CreateAt(A(), MeshBytes(1000));
  ASSERT_TRUE(A().Write(caller_, name)->Append(0, std::string(600, 'x')).ok());
  EXPECT_EQ(UploadReason(B().Write(caller_, name)->Append(600, std::string(400, 'x'))), "DIGEST_MISMATCH");
  EXPECT_EQ(UploadReason(A().Get(caller_, name).status()), "UPLOAD_NOT_FOUND");
  EXPECT_THAT(Parts(), IsEmpty());
}

TEST_P(SharedUploads, WhatIsLostComesAgain) {
  const std::string bytes = MeshBytes(3000);
  const std::string name = CreateAt(A(), bytes);
  ASSERT_TRUE(A().Write(caller_, name)->Append(0, bytes.substr(0, 1000)).ok());
  const std::vector<BlobId> first = Parts();
  ASSERT_TRUE(A().Write(caller_, name)->Append(1000, bytes.substr(1000, 1000)).ok());
  for (const BlobId& part : Parts()) {
    if (part == first.at(0)) continue;
    EXPECT_TRUE(*fronts_[0].store->Remove(part, absl::ZeroDuration()));
  }
  const absl::Status lost = B().Write(caller_, name)->Append(2000, bytes.substr(2000));
  EXPECT_EQ(UploadReason(lost), "UPLOAD_OFFSET_MISMATCH");
  EXPECT_EQ(ErrorInfoOf(lost).metadata.at("committed_bytes"), "1000");
  EXPECT_EQ(Committed(A(), name), 1000);
  ASSERT_EQ(B().Write(caller_, name)->Append(1000, bytes.substr(1000)), absl::OkStatus());
  ExpectMesh(A(), name, bytes);
}

TEST_P(SharedUploads, IdleOnesGoWhoeverLooks) {
  const std::string bytes = MeshBytes(1000);
  const std::string name = CreateAt(A(), bytes), used = CreateAt(A(), "used");
  ASSERT_TRUE(A().Write(caller_, name)->Append(0, bytes.substr(0, 400)).ok());
  ASSERT_TRUE(A().Write(caller_, used)->Append(0, "used").ok());
  EXPECT_TRUE(B().Uses({"ann", Sha256(bytes)}));
  now_ += options_.idle_limit - absl::Seconds(1);
  EXPECT_TRUE(A().Use(caller_, used).ok());
  now_ += absl::Seconds(1);
  B().Tick(now_);
  EXPECT_EQ(UploadReason(A().Get(caller_, name).status()), "UPLOAD_NOT_FOUND");
  EXPECT_FALSE(B().Uses({"ann", Sha256(bytes)}));
  EXPECT_THAT(Parts(), IsEmpty());
  ExpectMesh(B(), used, "used");
}

// The connection to the database dies at every statement of an upload in turn, with and without having done it. The
// client asks where it stands and goes on, at the other server.
TEST_P(SharedUploads, GoesOnAfterEveryLostConnection) {
  const std::string bytes = MeshBytes(3000);
  bool failed = true;
  for (int at = 1; failed && at < 100; ++at) {
    for (const bool answers : {true, false}) {
      SCOPED_TRACE(at);
      Fault fault;
      const Front front = Start(&fault);
      const std::string mesh = bytes + std::to_string(at) + (answers ? "a" : "b");
      const std::string name = CreateAt(A(), mesh);
      fault.count = 0;
      fault.at = at;
      fault.answers = answers;
      absl::Status status;
      {
        absl::StatusOr<UploadWriter> writer = front.uploads->Write(caller_, name);
        status = writer.status();
        if (status.ok()) status = writer->Append(0, mesh.substr(0, 1000));
        if (status.ok()) status = writer->Append(1000, mesh.substr(1000));
      }
      failed = fault.count >= at;
      EXPECT_THAT(UploadReason(status), ::testing::AnyOf("OK", "STORE_UNAVAILABLE"));
      now_ += options_.writer_limit;
      const std::int64_t committed = Committed(B(), name);
      EXPECT_EQ(B().Write(caller_, name)->Append(committed, mesh.substr(static_cast<std::size_t>(committed))),
                absl::OkStatus());
      ExpectMesh(A(), name, mesh);
    }
  }
  EXPECT_FALSE(failed) << "there are more statements than that";
  // What nobody refers to goes by the rule for all blobs.
  EXPECT_TRUE(CollectBlobs(fronts_[0].store.get(), absl::ZeroDuration(), [&](const BlobId& id) -> absl::StatusOr<bool> {
                return !SqlUploads::IsPart(id) || *fronts_[0].place->UsesPart(id);
              }).ok());
  EXPECT_THAT(Parts(), IsEmpty());
}

}  // namespace
}  // namespace planish
