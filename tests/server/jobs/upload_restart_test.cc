// Uploads across restarts, and on a full disk.
#include <sys/resource.h>

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

class UploadRestartTest : public UploadStoreTest {};
INSTANTIATE_TEST_SUITE_P(Everywhere, UploadRestartTest, ::testing::Values(true), [](const auto&) { return "Disk"; });

TEST_P(UploadRestartTest, GoesOnWhereTheProcessEnded) {
  const std::string bytes = Noise(3'000'000);
  const std::string name = CreateFor(bytes);
  ASSERT_TRUE(WriteOnce(name, 0, std::string_view(bytes).substr(0, 2'500'000)).ok());
  const std::string fresh = CreateFor("nothing yet");
  Start();
  EXPECT_EQ(Committed(name), 2'500'000);
  EXPECT_EQ(Committed(fresh), 0);
  EXPECT_TRUE(WriteOnce(name, 2'500'000, std::string_view(bytes).substr(2'500'000)).ok());
  EXPECT_TRUE(store_->Use(caller_, name)->mesh->bytes() == bytes) << "the digest covered what the first process wrote";
}

TEST_P(UploadRestartTest, TenantsOutliveTheProcess) {
  v1::CreateUploadRequest request;
  request.set_total_bytes(4);
  request.set_sha256(Sha256("mesh"));
  const Caller dashed = {"a-b_c-5", "", Rights{true, true, false, false}, ""};
  const std::string part = store_->Create(dashed, request)->name();
  const std::string done = store_->Create(kOther, request)->name();
  ASSERT_TRUE(store_->Write(kOther, done)->Append(0, "mesh").ok());
  Start();
  EXPECT_TRUE(store_->Use(kOther, done).ok());
  EXPECT_TRUE(store_->Write(dashed, part)->Append(0, "mesh").ok());
  EXPECT_FALSE(store_->Get(caller_, part).ok());
  EXPECT_FALSE(store_->Get(kOther, part).ok());
  Start();
  EXPECT_TRUE(store_->Use(dashed, part).ok());
}

TEST_P(UploadRestartTest, WhatWasThereBeforeTenantsIsTheDefaultTenants) {
  const std::string digest = absl::BytesToHexString(Sha256("mesh"));
  PutFile(dir_.Path("uploads/farm-1.old-4-" + digest + ".part"), "me");
  Start();
  EXPECT_EQ(Committed("uploads/farm-1.old"), 2);
  EXPECT_TRUE(WriteOnce("uploads/farm-1.old", 2, "sh").ok());
}

TEST_P(UploadRestartTest, EndedBetweenTheLastByteAndTheBlob) {
  const std::string bytes = Noise(1000);
  const std::string name = CreateFor(bytes);
  ASSERT_TRUE(WriteOnce(name, 0, bytes.substr(0, 999)).ok());
  ASSERT_EQ(Files().size(), 1u);
  const std::string path = dir_.Path("uploads/" + Files()[0]);
  store_ = nullptr;
  PutFile(path, bytes.substr(bytes.size() - 1), true);
  Start();
  EXPECT_EQ(Committed(name), 999) << "not complete, so not all bytes";
  EXPECT_TRUE(WriteOnce(name, 999, bytes.substr(999)).ok());
  EXPECT_TRUE(store_->Use(caller_, name)->mesh->bytes() == bytes);
}

TEST_P(UploadRestartTest, DamageIsFoundAndRubbishGoes) {
  const std::string bytes = Noise(1000);
  const std::string name = CreateFor(bytes);
  ASSERT_TRUE(WriteOnce(name, 0, bytes.substr(0, 500)).ok());
  const std::string path = dir_.Path("uploads/" + Files()[0]);
  store_ = nullptr;
  std::fstream(path, std::ios::in | std::ios::out | std::ios::binary).seekp(100).put('!');
  for (const char* rubbish : {"x.part", "a-5-ff.part", "a-b-c.done", "-1-2.part"}) {
    PutFile(dir_.Path("uploads/") + rubbish, "rubbish");
  }
  PutFile(dir_.Path("uploads/keep"), "not ours");
  Start();
  EXPECT_EQ(Files().size(), 2u) << "the upload, and what is not named like one";
  EXPECT_EQ(ReasonOf(WriteOnce(name, 500, bytes.substr(500))), "DIGEST_MISMATCH");
}

// Writes of this process beyond `bytes` of any file fail, as on a full disk: the first one short, the next with EFBIG.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  void (*handler_)(int);
  rlimit before_ = {};
};

TEST_P(UploadRestartTest, FullDiskCorruptsNothing) {
  const std::string bytes = Noise(50'000);
  const std::string name = CreateFor(bytes);
  ASSERT_TRUE(WriteOnce(name, 0, std::string_view(bytes).substr(0, 8'000)).ok());
  {
    const FileSizeLimit limit(20'000);
    const absl::Status full = WriteOnce(name, 8'000, std::string_view(bytes).substr(8'000, 30'000));
    EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted);
    EXPECT_EQ(ReasonOf(full), "STORAGE_FULL");
    EXPECT_EQ(ToRpcStatus(full).details_size(), 2) << "with a RetryInfo";
    EXPECT_EQ(Committed(name), 8'000);
    EXPECT_EQ(fs::file_size(dir_.Path("uploads/" + Files()[0])), 8'000u) << "half a piece would be taken for a whole";
    EXPECT_TRUE(WriteOnce(name, 8'000, std::string_view(bytes).substr(8'000, 1'000)).ok()) << "smaller pieces fit";
  }
  EXPECT_TRUE(WriteOnce(name, 9'000, std::string_view(bytes).substr(9'000)).ok());
  EXPECT_TRUE(store_->Use(caller_, name)->mesh->bytes() == bytes);
}

}  // namespace
}  // namespace planish
