// Blobs that several servers share, while the database fails and while catalogs disagree.
#include <map>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/blobs/blob_catalog.h"
#include "server/blobs/directory_blobs.h"
#include "server/store/job_store.h"
#include "server/store/sql_blobs.h"
#include "tests/server/store/failing_database.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

BlobId AnnsBlob(const std::string& bytes) {
  return {"ann", Sha256(bytes)};
}

std::string BlobReason(const absl::Status& status) {
  return status.ok() ? "OK" : ErrorInfoOf(status).reason;
}

class PostgresBlobs : public ::testing::Test {
 protected:
  static PostgresServer& Server() {
    static PostgresServer server;
    return server;
  }

  PostgresBlobs() : url_(Server().NewDatabase()) {
    database_ = std::make_unique<FailingDatabase>(OpenPostgresDatabase({.url = url_}).value(), &fault_);
    store_ = SqlBlobStore::Make(database_.get()).value();
  }

  std::int64_t Count(const std::string& table) {
    fault_ = {};
    return (*database_->Connect(SqlDatabase::Use::kRead))->Run("SELECT count(*) FROM " + table, {})->Int(0, 0);
  }

  const std::string url_;
  Fault fault_;
  std::unique_ptr<SqlDatabase> database_;
  std::unique_ptr<SqlBlobStore> store_;
};

// At every statement in turn, with and without having done it. A call that fails may be made again, and no chunk is
// left without its blob.
TEST_F(PostgresBlobs, TheConnectionDiesInEveryCall) {
  const std::string bytes(600'000, 'b');
  bool failed = true;
  for (int at = 1; failed && at < 50; ++at) {
    for (const bool answers : {true, false}) {
      SCOPED_TRACE(at);
      fault_ = {};
      fault_.at = at;
      fault_.answers = answers;
      const absl::Status put = store_->Put(AnnsBlob(bytes), bytes);
      const absl::StatusOr<bool> renewed = store_->Renew(AnnsBlob(bytes));
      const absl::StatusOr<bool> removed = store_->Remove(AnnsBlob(bytes), absl::ZeroDuration());
      failed = fault_.count >= at;
      for (const absl::Status& status : {put, renewed.status(), removed.status()}) {
        EXPECT_THAT(BlobReason(status), ::testing::AnyOf("OK", "STORE_UNAVAILABLE"));
      }
      fault_ = {};
      ASSERT_EQ(store_->Put(AnnsBlob(bytes), bytes), absl::OkStatus());
      EXPECT_TRUE((*store_->Load(AnnsBlob(bytes)))->bytes() == bytes);
      EXPECT_EQ(Count("stored_blobs"), 1);
      EXPECT_EQ(Count("blob_chunks"), 3);
      EXPECT_EQ(store_->Remove(AnnsBlob(bytes), absl::ZeroDuration()).value(), true);
      EXPECT_EQ(Count("blob_chunks"), 0);
    }
  }
  EXPECT_FALSE(failed) << "there are more statements than that";
}

TEST_F(PostgresBlobs, TheServerDiesAndComesBack) {
  ASSERT_TRUE(store_->Put(AnnsBlob("kept"), "kept").ok());
  const StoredBlobPtr open = *store_->Open(AnnsBlob("kept"));
  Server().Crash();
  EXPECT_EQ(BlobReason(store_->Put(AnnsBlob("new"), "new")), "STORE_UNAVAILABLE");
  EXPECT_EQ(BlobReason(store_->Has(AnnsBlob("kept")).status()), "STORE_UNAVAILABLE");
  EXPECT_EQ(BlobReason(open->ReadAll().status()), "STORE_UNAVAILABLE");
  Server().Start();
  EXPECT_EQ(open->ReadAll().value(), "kept");
  EXPECT_EQ(store_->Has(AnnsBlob("new")).value(), false);
  EXPECT_TRUE(store_->Put(AnnsBlob("new"), "new").ok());
}

TEST_F(PostgresBlobs, ADatabaseOfANewerVersionIsLeftAlone) {
  ASSERT_TRUE((*database_->Connect(SqlDatabase::Use::kWrite))
                  ->Run("UPDATE table_groups SET version = version + 1 WHERE name = 'blobs'", {})
                  .ok());
  EXPECT_EQ(BlobReason(SqlBlobStore::Make(database_.get()).status()), "STORE_VERSION");
}

TEST(SqliteBlobs, AreNotForSeveralServers) {
  const auto database = OpenSqliteDatabase(":memory:").value();
  EXPECT_EQ(BlobReason(SqlBlobStore::Make(database.get()).status()), "STORE_UNFIT");
}

// Two servers, each with its catalog, over one directory.
class SharedCatalogs : public ::testing::Test {
 protected:
  SharedCatalogs() {
    for (auto& catalog : catalogs_) catalog = Start();
  }

  std::unique_ptr<BlobCatalog> Start(TenantLimitsSource limits = nullptr) {
    BlobPlaces places;
    places.store = DirectoryBlobStore::Make({.directory = directory_.Path(), .shared = true}).value();
    places.rows = &rows_;
    auto catalog = std::make_unique<BlobCatalog>(std::move(places), 10'000'000, std::move(limits));
    EXPECT_TRUE(catalog->Open().ok());
    return catalog;
  }

  // Rows of a database that both reach.
  class Rows : public BlobRows {
   public:
    absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> List() override {
      std::vector<std::pair<BlobId, std::int64_t>> list;
      for (const auto& [id, bytes] : bytes_) list.emplace_back(id, bytes.size());
      return list;
    }
    absl::StatusOr<std::string> Read(const BlobId& id) override {
      const auto found = bytes_.find(id);
      if (found == bytes_.end()) return BlobNotFound(id);
      return found->second;
    }
    absl::StatusOr<bool> Remove(const BlobId& id) override {
      bytes_.erase(id);
      return true;
    }
    std::map<BlobId, std::string> bytes_;
  };

  // As a job's record is committed.
  void Commit(BlobCatalog& catalog, const BlobId& id) {
    const StoredBlobPtr pending = catalog.Pending(id);
    ASSERT_NE(pending, nullptr);
    rows_.bytes_[id] = *pending->ReadAll();
    catalog.Committed(id);
  }

  BlobCatalog& A() { return *catalogs_[0]; }
  BlobCatalog& B() { return *catalogs_[1]; }

  const TempDir directory_;
  Rows rows_;
  std::unique_ptr<BlobCatalog> catalogs_[2];
};

TEST_F(SharedCatalogs, WhatOneServerPutsTheOtherFinds) {
  const std::string large(BlobRows::kMostBytes + 1, 'l');
  ASSERT_TRUE(A().Put("ann", large).ok());
  EXPECT_TRUE(B().Has(AnnsBlob(large)));
  EXPECT_TRUE((*B().Find(AnnsBlob(large)))->ReadAll().value() == large);
  EXPECT_TRUE((*B().Load(AnnsBlob(large)))->bytes() == large);
  EXPECT_EQ(B().bytes("ann"), static_cast<std::int64_t>(large.size()));

  ASSERT_TRUE(A().Put("ann", "small").ok());
  EXPECT_EQ(BlobReason(B().Find(AnnsBlob("small")).status()), "BLOB_NOT_FOUND") << "it is not committed";
  Commit(A(), AnnsBlob("small"));
  EXPECT_EQ((*B().Find(AnnsBlob("small")))->ReadAll().value(), "small");
  EXPECT_EQ((*B().Load(AnnsBlob("small")))->bytes(), "small");
}

// A server cannot know who refers to a blob by now: what is young stays, whatever its own memory says.
TEST_F(SharedCatalogs, NothingYoungGoesByWhatOneServerRemembers) {
  const std::string large(BlobRows::kMostBytes + 1, 'l');
  ASSERT_TRUE(A().Put("ann", large).ok());
  EXPECT_TRUE(A().Remove(AnnsBlob(large))) << "there is nothing more to do";
  EXPECT_TRUE((*B().Find(AnnsBlob(large)))->ReadAll().value() == large);
  EXPECT_EQ(A().bytes(), static_cast<std::int64_t>(large.size()));
}

// A row that this server committed once may be gone: it goes with the next record too.
TEST_F(SharedCatalogs, SmallBlobsAreCommittedWithEachRecord) {
  ASSERT_TRUE(A().Put("ann", "small").ok());
  Commit(A(), AnnsBlob("small"));
  rows_.bytes_.clear();
  ASSERT_TRUE(A().Put("ann", "small").ok());
  Commit(A(), AnnsBlob("small"));
  EXPECT_EQ((*B().Find(AnnsBlob("small")))->ReadAll().value(), "small");
  EXPECT_EQ(A().bytes("ann"), 5);
}

TEST_F(SharedCatalogs, LimitsOfTenants) {
  const auto limited = Start([](const std::string&) {
    TenantLimits limits;
    limits.store_bytes = 1'000'000;
    return limits;
  });
  const std::string first(600'000, '1'), second(600'000, '2');
  EXPECT_TRUE(limited->Put("ann", first).ok());
  EXPECT_EQ(BlobReason(limited->Put("ann", second).status()), "STORAGE_FULL");
  EXPECT_EQ(limited->bytes("ann"), 600'000) << "what was refused takes no room";
  EXPECT_TRUE(limited->Put("bob", second).ok());
}

}  // namespace
}  // namespace planish
