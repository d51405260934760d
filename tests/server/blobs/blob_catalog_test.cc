#include "server/blobs/blob_catalog.h"

#include <sys/resource.h>

#include <csignal>
#include <filesystem>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/access/caller.h"
#include "tests/server/blobs/blobs_in.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

BlobId Own(const std::string& bytes) {
  return {kDefaultTenant, Sha256(bytes)};
}

// In memory, and in files.
class BlobCatalogTest : public ::testing::TestWithParam<bool> {
 protected:
  BlobCatalogTest() { Open(); }

  void Open(std::int64_t max_bytes = 1000) {
    store_ = std::make_unique<BlobCatalog>(BlobPlaces{BlobsIn(GetParam() ? directory_.Path("") : "")}, max_bytes);
    ASSERT_TRUE(store_->Open().ok());
  }

  const TempDir directory_;
  std::unique_ptr<BlobCatalog> store_;
};

TEST_P(BlobCatalogTest, KeepsEqualBytesOnce) {
  const auto first = store_->Put(kDefaultTenant, "hello");
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ((*first)->ReadAll().value(), "hello");
  EXPECT_TRUE(store_->Put(kDefaultTenant, "hello").ok());
  EXPECT_EQ(store_->bytes(), 5);
  EXPECT_EQ((*store_->Find(Own("hello")))->ReadAll().value(), "hello");
  EXPECT_EQ(ErrorInfoOf(store_->Find(Own("other")).status()).reason, "BLOB_NOT_FOUND");
}

TEST_P(BlobCatalogTest, NothingGoesWhileItIsHeld) {
  auto held = *store_->Put(kDefaultTenant, "held");
  store_->Put(kDefaultTenant, "not held").IgnoreError();
  store_->Collect([](const BlobId&) { return false; });
  EXPECT_TRUE(store_->Has(Own("held")));
  EXPECT_FALSE(store_->Has(Own("not held")));
  EXPECT_FALSE(store_->Remove(Own("held")));
  EXPECT_EQ(held->ReadAll().value(), "held");
  held.reset();
  EXPECT_TRUE(store_->Remove(Own("held")));
  EXPECT_TRUE(store_->Remove(Own("held")));
  EXPECT_EQ(store_->bytes(), 0);
}

TEST_P(BlobCatalogTest, CollectKeepsWhatIsUsed) {
  store_->Put(kDefaultTenant, "used").IgnoreError();
  store_->Collect([](const BlobId& id) { return id == Own("used"); });
  EXPECT_TRUE(store_->Has(Own("used")));
}

TEST_P(BlobCatalogTest, RefusesBeyondItsLimit) {
  Open(10);
  EXPECT_TRUE(store_->Put(kDefaultTenant, "0123456789").ok());
  EXPECT_EQ(ErrorInfoOf(store_->Put(kDefaultTenant, "x").status()).reason, "STORAGE_FULL");
  EXPECT_TRUE(store_->Put(kDefaultTenant, "0123456789").ok()) << "it has these already";
}

TEST_P(BlobCatalogTest, TakesOverFiles) {
  const TempDir elsewhere;
  const std::string path = elsewhere.Path("upload");
  PutFile(path, "uploaded");
  const absl::Status status = store_->PutFile(Own("uploaded"), path);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_EQ((*store_->Find(Own("uploaded")))->ReadAll().value(), "uploaded");
}

TEST_P(BlobCatalogTest, EmptyBytesAreBytes) {
  const auto blob = store_->Put(kDefaultTenant, "");
  ASSERT_TRUE(blob.ok()) << blob.status();
  EXPECT_EQ((*blob)->ReadAll().value(), "");
}

INSTANTIATE_TEST_SUITE_P(Everywhere, BlobCatalogTest, ::testing::Bool(),
                         [](const auto& which) { return which.param ? "Files" : "Memory"; });

TEST(BlobCatalogFiles, OutliveTheStoreAndHalfWrittenOnesDoNot) {
  const TempDir directory;
  const auto files = [&] {
    int count = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory.Path(""))) {
      count += entry.is_regular_file() ? 1 : 0;
    }
    return count;
  };
  {
    BlobCatalog store({BlobsIn(directory.Path(""))}, 1000);
    ASSERT_TRUE(store.Open().ok());
    ASSERT_TRUE(store.Put(kDefaultTenant, "kept").ok());
  }
  PutFile(directory.Path("new-7"), "ha");
  BlobCatalog store({BlobsIn(directory.Path(""))}, 1000);
  ASSERT_TRUE(store.Open().ok());
  EXPECT_EQ(store.bytes(), 4);
  EXPECT_EQ((*store.Find(Own("kept")))->ReadAll().value(), "kept");
  EXPECT_EQ(files(), 1);
  store.Collect([](const BlobId&) { return false; });
  EXPECT_EQ(files(), 0);
}

TEST_P(BlobCatalogTest, EachTenantHasItsOwn) {
  const BlobId other = {"other", Sha256("same")};
  ASSERT_TRUE(store_->Put(kDefaultTenant, "same").ok());
  EXPECT_FALSE(store_->Has(other));
  ASSERT_TRUE(store_->Put("other", "same").ok());
  EXPECT_EQ(store_->bytes(), 8);
  EXPECT_EQ(store_->bytes("other"), 4);
  EXPECT_TRUE(store_->Remove(Own("same")));
  EXPECT_EQ((*store_->Find(other))->ReadAll().value(), "same");
  EXPECT_EQ(store_->bytes(kDefaultTenant), 0);
  if (!GetParam()) return;
  Open();
  EXPECT_EQ((*store_->Find(other))->ReadAll().value(), "same") << "after a restart too";
  EXPECT_FALSE(store_->Has(Own("same")));
  EXPECT_EQ(store_->bytes("other"), 4);
}

TEST_P(BlobCatalogTest, LimitsOfATenant) {
  store_ = std::make_unique<BlobCatalog>(BlobPlaces{BlobsIn(GetParam() ? directory_.Path("") : "")}, 100, [](const std::string& tenant) {
    TenantLimits limits;
    if (tenant == "small") limits.store_bytes = 10;
    return limits;
  });
  EXPECT_TRUE(store_->Put("small", "0123456789").ok());
  const absl::Status full = store_->Put("small", "x").status();
  EXPECT_EQ(ErrorInfoOf(full).reason, "STORAGE_FULL");
  EXPECT_THAT(std::string(full.message()), ::testing::HasSubstr("tenant small"));
  EXPECT_TRUE(store_->Put("large", std::string(80, 'x')).ok());
  EXPECT_EQ(store_->WhoGivesWay("small", 1), "small") << "it has all it may have";
  EXPECT_EQ(store_->WhoGivesWay("large", 11), "large") << "it has most";
  EXPECT_EQ(store_->WhoGivesWay("third", 11), "large") << "a third of the store is there for each";
  EXPECT_EQ(store_->WhoGivesWay("third", 34), "third") << "but no more";
}

// The same error as of a disk that is full, from the same system call.
TEST(BlobCatalogFiles, ADiskThatIsFullIsSaidAndLeavesNothing) {
  const TempDir directory;
  BlobCatalog store({BlobsIn(directory.Path(""))}, 1 << 30);
  ASSERT_TRUE(store.Open().ok());
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {1000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  const absl::Status status = store.Put(kDefaultTenant, std::string(5000, 'x')).status();
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(ErrorInfoOf(status).reason, "STORAGE_FULL");
  EXPECT_EQ(store.bytes(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(directory.Path("")));
  EXPECT_TRUE(store.Put(kDefaultTenant, std::string(5000, 'x')).ok()) << "once there is room again";
}

}  // namespace
}  // namespace planish
