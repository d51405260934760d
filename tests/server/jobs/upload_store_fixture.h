// An UploadStore, in memory or in a directory.
#pragma once

#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gtest/gtest.h"
#include "server/jobs/upload_store.h"
#include "tests/server/blobs/blobs_in.h"
#include "tests/testing/files.h"

namespace planish {

// A store, in memory or in a directory, with a clock that stands still, and the blobs behind it.
class UploadStoreTest : public ::testing::TestWithParam<bool> {
 protected:
  UploadStoreTest() {
    std::filesystem::create_directories(dir_.Path("uploads"));
    std::filesystem::create_directories(dir_.Path("blobs"));
    if (OnDisk()) options_.directory = dir_.Path("uploads");
    options_.clock = [this] { return now_; };
    options_.new_id = [this] { return "u" + std::to_string(++ids_); };
    Start();
  }

  static std::string Noise(std::size_t size, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::string bytes(size, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    return bytes;
  }

  static std::string ReasonOf(const absl::Status& status) {
    return status.ok() ? "OK" : ErrorInfoOf(status).reason;
  }

  static bool OnDisk() { return GetParam(); }

  void Start(std::int64_t max_blob_bytes = std::int64_t{1} << 30) {
    store_ = nullptr;
    blobs_ = std::make_unique<BlobCatalog>(BlobPlaces{BlobsIn(OnDisk() ? dir_.Path("blobs") : "")}, max_blob_bytes);
    ASSERT_TRUE(blobs_->Open().ok());
    store_ = std::make_unique<UploadStore>(options_, blobs_.get());
    ASSERT_TRUE(store_->Open().ok());
  }

  absl::StatusOr<v1::Upload> Create(std::int64_t bytes, const std::string& sha256) {
    v1::CreateUploadRequest request;
    request.set_total_bytes(bytes);
    request.set_sha256(sha256);
    return store_->Create(caller_, request);
  }
  std::string CreateFor(const std::string& bytes) {
    return Create(static_cast<std::int64_t>(bytes.size()), Sha256(bytes))->name();
  }

  std::int64_t Committed(const std::string& name) { return store_->Get(caller_, name)->committed_bytes(); }

  // A whole call of one message.
  absl::Status WriteOnce(const std::string& name, std::int64_t offset, std::string_view data) {
    absl::StatusOr<UploadWriter> writer = store_->Write(caller_, name);
    return writer.ok() ? writer->Append(offset, data) : writer.status();
  }

  std::vector<std::string> Files() {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(dir_.Path("uploads"))) names.push_back(entry.path().filename());
    return names;
  }

  static BlobId Own(const std::string& bytes) { return {kDefaultTenant, Sha256(bytes)}; }

  const Caller kOther = {"other", "", Rights{true, true, false, false}, ""};
  const Caller caller_ = {kDefaultTenant, "", Rights::All(), ""};
  TempDir dir_;
  absl::Time now_ = absl::UnixEpoch() + absl::Hours(24);
  int ids_ = 0;
  UploadStoreOptions options_;
  std::unique_ptr<BlobCatalog> blobs_;
  std::unique_ptr<UploadStore> store_;
};

}  // namespace planish
