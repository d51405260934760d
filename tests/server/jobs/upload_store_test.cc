// Uploads by themselves: every order of calls.
#include "server/jobs/upload_store.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <random>

#include "absl/strings/escaping.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/link/rpc_status.h"
#include "tests/server/jobs/upload_store_fixture.h"

namespace planish {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;

INSTANTIATE_TEST_SUITE_P(Everywhere, UploadStoreTest, ::testing::Bool(),
                         [](const auto& param) { return param.param ? "Disk" : "Memory"; });

TEST_P(UploadStoreTest, PieceByPieceToABlob) {
  const std::string bytes = Noise(100'000);
  const absl::StatusOr<v1::Upload> upload = Create(100'000, Sha256(bytes));
  ASSERT_TRUE(upload.ok());
  EXPECT_THAT(upload->name(), ::testing::StartsWith("uploads/"));
  EXPECT_EQ(upload->committed_bytes(), 0);
  EXPECT_EQ(upload->total_bytes(), 100'000);
  EXPECT_EQ(upload->sha256(), Sha256(bytes));
  EXPECT_EQ(upload->expire_time().seconds(), absl::ToUnixSeconds(now_ + options_.idle_limit));
  EXPECT_TRUE(store_->Uses(Own(bytes))) << "what is to become a blob may not be collected on the way";
  {
    UploadWriter writer = *store_->Write(caller_, upload->name());
    EXPECT_TRUE(writer.Append(0, std::string_view(bytes).substr(0, 30'000)).ok());
    EXPECT_EQ(Committed(upload->name()), 30'000);
    EXPECT_TRUE(writer.Append(10'000, std::string_view(bytes).substr(10'000, 5'000)).ok()) << "known already";
    EXPECT_TRUE(writer.Append(20'000, std::string_view(bytes).substr(20'000, 40'000)).ok()) << "half of it is";
    EXPECT_TRUE(writer.Append(60'000, "").ok());
    EXPECT_EQ(ReasonOf(store_->Use(caller_, upload->name()).status()), "UPLOAD_INCOMPLETE");
    EXPECT_EQ(ErrorInfoOf(store_->Use(caller_, upload->name()).status()).metadata.at("committed_bytes"), "60000");
    EXPECT_TRUE(writer.Append(60'000, std::string_view(bytes).substr(60'000)).ok());
    EXPECT_TRUE(writer.Append(0, bytes).ok()) << "a complete upload skips all";
  }
  const absl::StatusOr<UploadedMesh> mesh = store_->Use(caller_, upload->name());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_TRUE(mesh->mesh->bytes() == bytes);
  EXPECT_EQ(mesh->sha256, Sha256(bytes));

  const absl::StatusOr<v1::Upload> again = Create(100'000, Sha256(bytes));
  EXPECT_NE(again->name(), upload->name());
  EXPECT_EQ(again->committed_bytes(), 100'000) << "the same bytes need not come twice";
  EXPECT_TRUE(store_->Delete(caller_, upload->name()).ok());
  EXPECT_TRUE(store_->Uses(Own(bytes)));
  EXPECT_TRUE(store_->Delete(caller_, again->name()).ok());
  EXPECT_FALSE(store_->Uses(Own(bytes)));
  EXPECT_THAT(Files(), IsEmpty());
}

TEST_P(UploadStoreTest, ARequestIdStandsForItsUploadAcrossARestart) {
  const std::string bytes = Noise(1000);
  v1::CreateUploadRequest request;
  request.set_total_bytes(1000);
  request.set_sha256(Sha256(bytes));
  request.set_request_id("once");
  const std::string name = store_->Create(caller_, request)->name();
  ASSERT_TRUE(WriteOnce(name, 0, std::string_view(bytes).substr(0, 400)).ok());
  if (OnDisk()) Start();
  const absl::StatusOr<v1::Upload> again = store_->Create(caller_, request);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->name(), name);
  EXPECT_EQ(again->committed_bytes(), 400) << "as it is";
  ASSERT_TRUE(WriteOnce(name, 400, std::string_view(bytes).substr(400)).ok());
  if (OnDisk()) Start();
  EXPECT_EQ(store_->Create(caller_, request)->committed_bytes(), 1000);
  EXPECT_EQ(store_->Create(caller_, request)->name(), name);

  const Caller other = {"other", "", Rights::All(), ""};
  EXPECT_NE(store_->Create(other, request)->name(), name) << "ids are each tenant's own";
  request.set_request_id("twice");
  EXPECT_NE(store_->Create(caller_, request)->name(), name);
  request.set_sha256(Sha256("other bytes"));
  const absl::Status reused = store_->Create(caller_, request).status();
  EXPECT_EQ(reused.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(ReasonOf(reused), "REQUEST_ID_REUSED");

  ASSERT_TRUE(store_->Delete(caller_, name).ok());
  request.set_request_id("once");
  const absl::StatusOr<v1::Upload> fresh = store_->Create(caller_, request);
  ASSERT_TRUE(fresh.ok()) << "the upload that it stood for is gone";
  EXPECT_EQ(fresh->committed_bytes(), 0);
}

TEST_P(UploadStoreTest, BadRequestsNameTheField) {
  const std::string digest = Sha256("x");
  for (const std::int64_t bytes : {std::int64_t{0}, std::int64_t{-1}}) {
    EXPECT_EQ(ErrorInfoOf(Create(bytes, digest).status()).metadata.at("field"), "total_bytes");
  }
  EXPECT_EQ(ErrorInfoOf(Create(1, "short").status()).metadata.at("field"), "sha256");
  const absl::Status large = Create(options_.max_mesh_bytes + 1, digest).status();
  EXPECT_EQ(large.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ReasonOf(large), "MESH_TOO_LARGE");
  EXPECT_EQ(ErrorInfoOf(large).metadata.at("limit"), std::to_string(options_.max_mesh_bytes));
  EXPECT_EQ(ErrorInfoOf(large).metadata.at("bytes"), std::to_string(options_.max_mesh_bytes + 1));

  for (const absl::Status& status :
       {store_->Get(caller_, "uploads/none").status(), store_->Delete(caller_, "uploads/none"),
        store_->Write(caller_, "").status(), store_->Use(caller_, "uploads/none").status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
    EXPECT_EQ(ReasonOf(status), "UPLOAD_NOT_FOUND");
  }
}

TEST_P(UploadStoreTest, OffsetsMustGoOnWhereTheBytesEnd) {
  const std::string bytes = Noise(100);
  const std::string name = CreateFor(bytes);
  UploadWriter writer = *store_->Write(caller_, name);
  EXPECT_TRUE(writer.Append(0, bytes.substr(0, 40)).ok());
  for (const auto& [offset, size] :
       std::map<std::int64_t, std::int64_t>{{41, 10}, {40, 61}, {1'000'000, 1}, {101, 0}}) {
    const absl::Status status = writer.Append(offset, std::string(static_cast<std::size_t>(size), 'x'));
    EXPECT_EQ(status.code(), absl::StatusCode::kOutOfRange) << offset;
    EXPECT_EQ(ReasonOf(status), "UPLOAD_OFFSET_MISMATCH");
    EXPECT_EQ(ErrorInfoOf(status).metadata.at("committed_bytes"), "40");
  }
  EXPECT_EQ(ReasonOf(writer.Append(-1, "x")), "REQUEST_INVALID");
  EXPECT_EQ(Committed(name), 40);
  EXPECT_TRUE(writer.Append(40, bytes.substr(40)).ok()) << "errors changed nothing";
  EXPECT_TRUE(store_->Use(caller_, name).ok());
}

TEST_P(UploadStoreTest, WrongDigestVoidsTheUpload) {
  const std::string name = Create(4, Sha256("good"))->name();
  const absl::Status status = WriteOnce(name, 0, "evil");
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ReasonOf(status), "DIGEST_MISMATCH");
  EXPECT_EQ(ReasonOf(store_->Get(caller_, name).status()), "UPLOAD_NOT_FOUND");
  EXPECT_FALSE(blobs_->Has(Own("good")));
  EXPECT_FALSE(blobs_->Has(Own("evil")));
  EXPECT_THAT(Files(), IsEmpty());
}

TEST_P(UploadStoreTest, OneWriterAtATimeUnlessItFellSilent) {
  const std::string bytes = Noise(100);
  const std::string name = CreateFor(bytes);
  std::optional<UploadWriter> first = *store_->Write(caller_, name);
  EXPECT_TRUE(first->Append(0, bytes.substr(0, 10)).ok());
  const absl::Status busy = store_->Write(caller_, name).status();
  EXPECT_EQ(busy.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(ReasonOf(busy), "UPLOAD_BUSY");

  now_ += options_.writer_limit;
  absl::StatusOr<UploadWriter> second = store_->Write(caller_, name);
  ASSERT_TRUE(second.ok()) << "the first one's connection is probably gone";
  EXPECT_EQ(ReasonOf(first->Append(10, bytes.substr(10))), "UPLOAD_BUSY");
  first.reset();
  EXPECT_EQ(ReasonOf(store_->Write(caller_, name).status()), "UPLOAD_BUSY")
      << "the end of the first is not that of the second";
  EXPECT_TRUE(second->Append(10, bytes.substr(10, 20)).ok());
  *second = UploadWriter();
  EXPECT_TRUE(WriteOnce(name, 30, bytes.substr(30)).ok());
  EXPECT_TRUE(store_->Use(caller_, name).ok());
}

TEST_P(UploadStoreTest, IdleOnesExpireAndUsedOnesDoNot) {
  const std::string under_way = CreateFor(Noise(100));
  const std::string complete = CreateFor("mesh");
  ASSERT_TRUE(WriteOnce(complete, 0, "mesh").ok());
  UploadWriter stalled = *store_->Write(caller_, under_way);

  now_ += options_.idle_limit - absl::Seconds(1);
  store_->Tick(now_);
  EXPECT_TRUE(store_->Use(caller_, complete).ok());
  EXPECT_TRUE(store_->Get(caller_, under_way).ok());
  now_ += absl::Seconds(1);
  store_->Tick(now_);
  EXPECT_TRUE(store_->Get(caller_, complete).ok()) << "it was used a second ago";
  EXPECT_EQ(ReasonOf(store_->Get(caller_, under_way).status()), "UPLOAD_NOT_FOUND");
  EXPECT_EQ(ReasonOf(stalled.Append(0, "x")), "UPLOAD_NOT_FOUND");
  now_ -= absl::Hours(10);
  store_->Tick(now_);
  EXPECT_TRUE(store_->Get(caller_, complete).ok()) << "a clock that is set back makes nothing older";
  now_ += absl::Hours(20);
  store_->Tick(now_);
  EXPECT_FALSE(store_->Uses(Own("mesh")));
  EXPECT_THAT(Files(), IsEmpty());
}

TEST_P(UploadStoreTest, BoundsOnWhatIsUnderWay) {
  options_.max_uploads = 3;
  options_.max_bytes = 1000;
  options_.max_complete = 2;
  Start();
  const std::string large = Create(5000, Sha256("a"))->name();
  const absl::Status no_bytes = Create(1, Sha256("b")).status();
  EXPECT_EQ(ReasonOf(no_bytes), "STORAGE_FULL");
  EXPECT_EQ(ToRpcStatus(no_bytes).details_size(), 2) << "with a RetryInfo";
  ASSERT_TRUE(store_->Delete(caller_, large).ok());

  std::vector<std::string> names;
  for (const char* mesh : {"1", "2", "3"}) names.push_back(CreateFor(mesh));
  const absl::Status no_place = Create(1, Sha256("4")).status();
  EXPECT_EQ(no_place.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ReasonOf(no_place), "QUEUE_FULL");
  EXPECT_EQ(ToRpcStatus(no_place).details_size(), 2) << "with a RetryInfo";

  for (std::size_t i = 0; i < names.size(); ++i) {
    now_ += absl::Seconds(1);
    EXPECT_TRUE(WriteOnce(names[i], 0, std::to_string(i + 1)).ok());
  }
  EXPECT_FALSE(store_->Get(caller_, names[0]).ok()) << "the complete one that nobody used for longest made room";
  EXPECT_TRUE(store_->Use(caller_, names[1]).ok());
  EXPECT_TRUE(store_->Use(caller_, names[2]).ok());
}

// What a program that died left under way.
TEST_P(UploadStoreTest, IdleUploadsGiveWayToNewOnesOfTheirTenant) {
  options_.max_uploads = 3;
  options_.max_bytes = 1000;
  Start();
  std::vector<std::string> names;
  for (const char* mesh : {"first", "second", "third"}) {
    names.push_back(CreateFor(mesh));
    now_ += absl::Seconds(10);
  }
  UploadWriter writer = *store_->Write(caller_, names[0]);
  ASSERT_TRUE(writer.Append(0, "fi").ok());
  EXPECT_EQ(ReasonOf(Create(1, Sha256("4")).status()), "QUEUE_FULL") << "all of them are young";
  now_ += options_.gives_way_after - absl::Seconds(10);
  EXPECT_TRUE(Create(1, Sha256("4")).ok());
  EXPECT_EQ(ReasonOf(store_->Get(caller_, names[1]).status()), "UPLOAD_NOT_FOUND") << "nobody used it for longest";
  EXPECT_EQ(Committed(names[0]), 2) << "it was written to last";
  now_ += absl::Hours(1) - absl::Seconds(1);
  EXPECT_TRUE(Create(900, Sha256("5")).ok()) << "for bytes, too";
  EXPECT_EQ(ReasonOf(store_->Get(caller_, names[2]).status()), "UPLOAD_NOT_FOUND");
  EXPECT_TRUE(writer.Append(2, "rst").ok());
}

TEST_P(UploadStoreTest, ListsWhatIsUnderWay) {
  std::vector<std::string> names;
  for (const char* mesh : {"first", "second", "third"}) {
    names.push_back(CreateFor(mesh));
    now_ += absl::Seconds(1);
  }
  ASSERT_TRUE(WriteOnce(names[1], 0, "second").ok());
  ASSERT_TRUE(WriteOnce(names[0], 0, "fi").ok());
  const absl::StatusOr<v1::ListUploadsResponse> list = store_->List(caller_);
  ASSERT_TRUE(list.ok());
  ASSERT_EQ(list->uploads_size(), 2) << "one is complete";
  EXPECT_EQ(list->uploads(0).name(), names[2]) << "the one not written to for longest comes first";
  EXPECT_EQ(list->uploads(1).name(), names[0]);
  EXPECT_EQ(list->uploads(1).committed_bytes(), 2);
  Caller other;
  other.tenant = "other";
  EXPECT_EQ(store_->List(other)->uploads_size(), 0);
}

TEST_P(UploadStoreTest, NoRoomForTheBlobLosesNothing) {
  Start(/*max_blob_bytes=*/150);
  ASSERT_TRUE(blobs_->Put(kDefaultTenant, Noise(100, 7)).ok());
  const std::string bytes = Noise(100);
  const std::string name = CreateFor(bytes);
  ASSERT_TRUE(WriteOnce(name, 0, bytes.substr(0, 60)).ok());
  const absl::Status full = WriteOnce(name, 60, bytes.substr(60));
  EXPECT_EQ(ReasonOf(full), "STORAGE_FULL");
  EXPECT_EQ(ToRpcStatus(full).details_size(), 2) << "with a RetryInfo";
  EXPECT_EQ(Committed(name), 60) << "the last piece must come again";
  EXPECT_EQ(ReasonOf(store_->Use(caller_, name).status()), "UPLOAD_INCOMPLETE");
  blobs_->Collect([](const BlobId&) { return false; });
  EXPECT_TRUE(WriteOnce(name, 60, bytes.substr(60)).ok());
  EXPECT_TRUE(store_->Use(caller_, name)->mesh->bytes() == bytes);
}

TEST_P(UploadStoreTest, NoRoomForTheBlobIsMadeWhereItCanBe) {
  Start(/*max_blob_bytes=*/150);
  ASSERT_TRUE(blobs_->Put(kDefaultTenant, Noise(100, 7)).ok());
  store_->SetMakeRoom([this](const std::string& tenant, std::int64_t bytes) {
    EXPECT_EQ(tenant, kDefaultTenant);
    EXPECT_EQ(bytes, 100);
    return blobs_->Remove(Own(Noise(100, 7)));
  });
  const std::string bytes = Noise(100);
  const std::string name = CreateFor(bytes);
  EXPECT_TRUE(WriteOnce(name, 0, bytes).ok());
  EXPECT_TRUE(store_->Use(caller_, name)->mesh->bytes() == bytes);
}

// ---- tenants

TEST_P(UploadStoreTest, AnotherTenantsUploadIsNone) {
  const std::string bytes = Noise(100);
  const std::string theirs = CreateFor(bytes);
  const std::string complete = CreateFor("mesh");
  ASSERT_TRUE(WriteOnce(complete, 0, "mesh").ok());
  for (const std::string& name : {theirs, complete}) {
    // Word for word what is said of an upload that never was, but for the name asked for.
    const auto expect_none = [&](const absl::Status& status, const absl::Status& none) {
      EXPECT_EQ(status.code(), none.code());
      EXPECT_EQ(ToRpcStatus(status).SerializeAsString().size(), ToRpcStatus(none).SerializeAsString().size());
      EXPECT_EQ(ReasonOf(status), "UPLOAD_NOT_FOUND");
      EXPECT_EQ(ErrorInfoOf(status).metadata, (std::map<std::string, std::string>{{"upload", name}}));
      EXPECT_EQ(status.message(), "there is no upload '" + name + "': it never was, or it expired or was deleted");
    };
    const std::string never = "uploads/" + std::string(name.size() - 8, '0');
    expect_none(store_->Get(kOther, name).status(), store_->Get(kOther, never).status());
    expect_none(store_->Delete(kOther, name), store_->Delete(kOther, never));
    expect_none(store_->Write(kOther, name).status(), store_->Write(kOther, never).status());
    expect_none(store_->Use(kOther, name).status(), store_->Use(kOther, never).status());
    EXPECT_TRUE(store_->Get(caller_, name).ok());
  }
}

TEST_P(UploadStoreTest, BytesThatOnlyOthersHaveMustBeSent) {
  const std::string name = CreateFor("mesh");
  ASSERT_TRUE(WriteOnce(name, 0, "mesh").ok());
  v1::CreateUploadRequest request;
  request.set_total_bytes(4);
  request.set_sha256(Sha256("mesh"));
  const v1::Upload other = *store_->Create(kOther, request);
  EXPECT_EQ(other.committed_bytes(), 0);
  EXPECT_TRUE(store_->Write(kOther, other.name())->Append(0, "mesh").ok());
  EXPECT_EQ(blobs_->bytes(), 8) << "each has its own, so room says nothing either";
  EXPECT_EQ(store_->Create(kOther, request)->committed_bytes(), 4) << "these are its own";
  ASSERT_TRUE(store_->Delete(caller_, name).ok());
  EXPECT_FALSE(store_->Uses(Own("mesh")));
  EXPECT_TRUE(store_->Use(kOther, other.name())->mesh->bytes() == "mesh");
}

TEST_P(UploadStoreTest, ATenantThatTakesAllLeavesOthersTheirPart) {
  options_.max_uploads = 4;
  options_.max_bytes = 1000;
  options_.max_complete = 2;
  Start();
  for (const char* mesh : {"1", "2", "3", "4"}) CreateFor(mesh);
  EXPECT_EQ(ReasonOf(Create(1, Sha256("5")).status()), "QUEUE_FULL");
  const auto create_other = [this](const std::string& mesh, std::int64_t bytes) {
    v1::CreateUploadRequest request;
    request.set_total_bytes(bytes);
    request.set_sha256(Sha256(mesh));
    return store_->Create(kOther, request).status();
  };
  EXPECT_TRUE(create_other("a", 996).ok());
  EXPECT_EQ(ReasonOf(create_other("b", 1)), "STORAGE_FULL") << "it has more than half of the bytes";
  EXPECT_TRUE(ErrorInfoOf(create_other("b", 1)).metadata.at("limit") == "1000");
}

TEST_P(UploadStoreTest, CompleteOnesOfOthersStay) {
  options_.max_complete = 1;
  Start();
  const std::string mine = CreateFor("mine");
  ASSERT_TRUE(WriteOnce(mine, 0, "mine").ok());
  for (const char* mesh : {"a", "b", "c"}) {
    v1::CreateUploadRequest request;
    request.set_total_bytes(1);
    request.set_sha256(Sha256(mesh));
    const v1::Upload other = *store_->Create(kOther, request);
    ASSERT_TRUE(store_->Write(kOther, other.name())->Append(0, mesh).ok());
  }
  EXPECT_TRUE(store_->Use(caller_, mine).ok());
}

// Random calls by several clients on several uploads, against a model of what must come out.
TEST_P(UploadStoreTest, EveryOrderOfCalls) {
  struct Model {
    std::string bytes;
    std::size_t committed = 0;
    bool exists = true;
  };
  std::mt19937 random(20);
  const auto below = [&random](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  std::map<std::string, Model> models;
  std::map<std::string, UploadWriter> writers;
  int completed = 0;
  for (int step = 0; step < 40'000; ++step) {
    const auto pick = [&] { return std::next(models.begin(), static_cast<std::ptrdiff_t>(below(models.size()))); };
    if (models.size() < 3 || (below(40) == 0 && models.size() < 60)) {
      const std::string bytes = Noise(1 + below(300), static_cast<unsigned>(step));
      models[CreateFor(bytes)].bytes = bytes;
      continue;
    }
    auto& [name, model] = *pick();
    if (!store_->Get(caller_, name).ok()) {
      ASSERT_FALSE(model.exists) << name;
      ASSERT_EQ(ReasonOf(store_->Write(caller_, name).status()), "UPLOAD_NOT_FOUND");
      continue;
    }
    ASSERT_TRUE(model.exists) << name;
    ASSERT_EQ(Committed(name), static_cast<std::int64_t>(model.committed));
    const bool complete = model.committed == model.bytes.size();
    switch (below(10)) {
      case 0: {
        absl::StatusOr<UploadWriter> writer = store_->Write(caller_, name);
        ASSERT_EQ(writer.ok(), !writers.contains(name));
        if (writer.ok()) writers[name] = *std::move(writer);
        break;
      }
      case 1:
        writers.erase(name);
        break;
      case 2:
        ASSERT_EQ(ReasonOf(store_->Use(caller_, name).status()), complete ? "OK" : "UPLOAD_INCOMPLETE");
        if (complete) {
          ASSERT_TRUE(store_->Use(caller_, name)->mesh->bytes() == model.bytes);
          ++completed;
        }
        break;
      case 3:
        if (below(30) != 0) break;
        ASSERT_TRUE(store_->Delete(caller_, name).ok());
        model.exists = false;
        break;
      default: {
        if (!writers.contains(name)) break;
        const std::size_t offset = below(5) == 0 ? below(400) : model.committed - std::min(model.committed, below(20));
        const std::size_t size = below(120);
        const bool fits = offset <= model.committed && offset + size <= model.bytes.size();
        const std::string data = fits ? model.bytes.substr(offset, size) : std::string(size, 'x');
        ASSERT_EQ(ReasonOf(writers[name].Append(static_cast<std::int64_t>(offset), data)),
                  fits ? "OK" : "UPLOAD_OFFSET_MISMATCH");
        if (fits) model.committed = std::max(model.committed, offset + size);
      }
    }
    if (OnDisk() && below(300) == 0) {  // a crash: writers vanish, the process starts anew
      writers.clear();
      Start();
    }
  }
  EXPECT_GT(completed, 50);
}

}  // namespace
}  // namespace planish
