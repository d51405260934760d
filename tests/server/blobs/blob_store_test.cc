// What every BlobStore promises: one suite for all of them.
#include "server/blobs/blob_store.h"

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <thread>

#include "absl/strings/escaping.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/blobs/directory_blobs.h"
#include "server/blobs/s3_blobs.h"
#include "server/store/sql_blobs.h"
#include "tests/server/blobs/s3_server.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

BlobId IdOf(const std::string& bytes, const std::string& tenant = "ann") {
  return {tenant, Sha256(bytes)};
}

std::string RandomBytes(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

std::string ReasonIn(const absl::Status& status) {
  return status.ok() ? "OK" : ErrorInfoOf(status).reason;
}

// Where the stores of one test are.
class StorePlace {
 public:
  virtual ~StorePlace() = default;

  // Each store is like another process: it knows nothing that is not in the place.
  virtual std::unique_ptr<BlobStore> Open() = 0;

  // What goes wrong on disks: the blob has these bytes instead.
  virtual void Replace(const BlobId& id, const std::string& bytes) = 0;
  // The blob was put so much earlier.
  virtual void MakeOlder(const BlobId& id, absl::Duration by) = 0;
};

void ShiftFile(const fs::path& file, absl::Duration by) {
  fs::last_write_time(file, fs::last_write_time(file) - absl::ToChronoSeconds(by));
}

class DirectoryPlace : public StorePlace {
 public:
  explicit DirectoryPlace(bool shared) : shared_(shared) {}

  std::unique_ptr<BlobStore> Open() override {
    return DirectoryBlobStore::Make({.directory = directory_.Path(), .shared = shared_}).value();
  }
  void Replace(const BlobId& id, const std::string& bytes) override { PutFile(PathOf(id), bytes); }
  void MakeOlder(const BlobId& id, absl::Duration by) override { ShiftFile(PathOf(id), by); }

 private:
  std::string PathOf(const BlobId& id) const {
    const std::string name = absl::BytesToHexString(id.sha256);
    return directory_.Path("tenant-" + id.tenant + "/" + name.substr(0, 2) + "/" + name);
  }

  const bool shared_;
  const TempDir directory_;
};

class PostgresPlace : public StorePlace {
 public:
  PostgresPlace() : database_(OpenPostgresDatabase({.url = Server().NewDatabase()}).value()) {}

  std::unique_ptr<BlobStore> Open() override { return SqlBlobStore::Make(database_.get()).value(); }
  void Replace(const BlobId& id, const std::string& bytes) override {
    const std::int64_t number = NumberOf(id);
    Run("DELETE FROM blob_chunks WHERE blob = ?", {number});
    // Chunks have 256 KiB.
    for (std::size_t offset = 0; offset < bytes.size(); offset += 262144) {
      const std::string_view chunk = std::string_view(bytes).substr(offset, 262144);
      Run("INSERT INTO blob_chunks VALUES (?, ?, ?)",
          {number, static_cast<std::int64_t>(offset / 262144), SqlBytes{chunk}});
    }
  }
  void MakeOlder(const BlobId& id, absl::Duration by) override {
    Run("UPDATE stored_blobs SET put_time = put_time - ? WHERE number = ?",
        {absl::ToInt64Nanoseconds(by), NumberOf(id)});
  }

 private:
  // Started by the first test of the process.
  static PostgresServer& Server() {
    static PostgresServer server;
    return server;
  }

  SqlRows Run(const std::string& sql, const std::vector<SqlValue>& values) {
    return (*database_->Connect(SqlDatabase::Use::kWrite))->Run(sql, values).value();
  }
  std::int64_t NumberOf(const BlobId& id) {
    return Run("SELECT number FROM stored_blobs WHERE tenant = ? AND sha256 = ?",
               {std::string_view(id.tenant), SqlBytes{id.sha256}})
        .Int(0, 0);
  }

  const std::unique_ptr<SqlDatabase> database_;
};

class S3Place : public StorePlace {
 public:
  S3Place() {
    static int places = 0;
    options_.s3 = Server().Options();
    options_.s3.prefix = "some where/" + std::to_string(++places);
    // The server answers with 500 for as long as it takes it to remove what it copies or reads.
    options_.s3.attempts = S3Options().attempts;
    options_.s3.first_delay = absl::Milliseconds(20);
  }

  // Started by the first test of the process.
  static S3Server& Server() {
    static S3Server server;
    return server;
  }

  std::unique_ptr<BlobStore> Open() override { return S3BlobStore::Make(options_).value(); }
  void Replace(const BlobId& id, const std::string& bytes) override {
    for (const std::string& key : KeysOf(id)) PutFile(Server().FileOf(key), bytes);
  }
  void MakeOlder(const BlobId& id, absl::Duration by) override {
    for (const std::string& key : KeysOf(id)) ShiftFile(Server().FileOf(key), by);
  }

 private:
  std::vector<std::string> KeysOf(const BlobId& id) {
    std::vector<std::string> keys;
    EXPECT_TRUE(S3Client(options_.s3)
                    .List(id.tenant + "/" + absl::BytesToHexString(id.sha256) + "/",
                          [&](const S3Object& each) { keys.push_back(options_.s3.prefix + "/" + each.key); })
                    .ok());
    return keys;
  }

  S3BlobsOptions options_;
};

struct Engine {
  const char* name;
  std::function<std::unique_ptr<StorePlace>()> place;
  std::function<std::string()> why_not = [] { return std::string(); };
};

std::ostream& operator<<(std::ostream& out, const Engine& engine) {
  return out << engine.name;
}

class BlobStoreTest : public ::testing::TestWithParam<Engine> {
 protected:
  void SetUp() override {
    if (const std::string why = GetParam().why_not(); !why.empty()) GTEST_SKIP() << why;
    place_ = GetParam().place();
    store_ = place_->Open();
  }

  // As after a restart, or on another machine.
  std::unique_ptr<BlobStore> Another() { return place_->Open(); }
  // One that works at the same time: the same one where the place belongs to one store.
  std::shared_ptr<BlobStore> Neighbour() {
    return store_->is_shared() ? std::shared_ptr<BlobStore>(Another())
                               : std::shared_ptr<BlobStore>(std::shared_ptr<void>(), store_.get());
  }

  static std::string Read(BlobStore& store, const BlobId& id) {
    const absl::StatusOr<StoredBlobPtr> blob = store.Open(id);
    if (!blob.ok()) return ReasonIn(blob.status());
    const absl::StatusOr<std::string> bytes = (*blob)->ReadAll();
    return bytes.ok() ? *bytes : ReasonIn(bytes.status());
  }

  static std::map<BlobId, std::int64_t> Sizes(BlobStore& store) {
    std::map<BlobId, std::int64_t> sizes;
    const absl::Status status = store.List([&](const BlobEntry& entry) {
      EXPECT_TRUE(sizes.emplace(entry.id, entry.bytes).second) << "listed twice";
      EXPECT_GE(entry.age, -absl::Seconds(1));
    });
    EXPECT_TRUE(status.ok()) << status;
    return sizes;
  }

  std::unique_ptr<StorePlace> place_;
  std::unique_ptr<BlobStore> store_;
};

TEST_P(BlobStoreTest, WhatIsPutIsThereForOthers) {
  const std::string small = "hello", large = RandomBytes(3'000'001, 1);
  for (const std::string& bytes : {small, large, std::string()}) {
    const absl::Status status = store_->Put(IdOf(bytes), bytes);
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_EQ(store_->Has(IdOf(bytes)).value(), true);
    EXPECT_TRUE(Read(*store_, IdOf(bytes)) == bytes);
    const auto other = Another();
    EXPECT_EQ(other->Has(IdOf(bytes)).value(), true);
    EXPECT_TRUE(Read(*other, IdOf(bytes)) == bytes);
    EXPECT_TRUE((*Another()->Load(IdOf(bytes)))->bytes() == bytes);
  }
  EXPECT_THAT(Sizes(*Another()), ::testing::SizeIs(3));
}

TEST_P(BlobStoreTest, WhatIsNotThere) {
  const BlobId id = IdOf("nothing");
  EXPECT_EQ(store_->Has(id).value(), false);
  EXPECT_EQ(store_->Renew(id).value(), false);
  EXPECT_EQ(ReasonIn(store_->Open(id).status()), "BLOB_NOT_FOUND");
  EXPECT_EQ(ReasonIn(store_->Load(id).status()), "BLOB_NOT_FOUND");
  EXPECT_EQ(store_->Remove(id, absl::ZeroDuration()).value(), true);
  EXPECT_EQ(store_->Remove(id, absl::Hours(1)).value(), true);
  EXPECT_TRUE(Sizes(*store_).empty());
}

TEST_P(BlobStoreTest, ReadsRanges) {
  const std::string bytes = RandomBytes(1'000'000, 2);
  ASSERT_TRUE(store_->Put(IdOf(bytes), bytes).ok());
  const StoredBlobPtr blob = *Another()->Open(IdOf(bytes));
  ASSERT_EQ(blob->size(), 1'000'000);
  std::string read;
  std::mt19937 random(3);
  for (int i = 0; i < 50; ++i) {
    const std::int64_t offset = random() % 1'000'000;
    const std::int64_t length = random() % (1'000'001 - offset);
    ASSERT_TRUE(blob->Read(offset, length, &read).ok());
    ASSERT_TRUE(read == bytes.substr(offset, length)) << offset << " " << length;
  }
  for (const std::int64_t edge : {0, 262'142, 262'143, 262'144, 999'998}) {
    ASSERT_TRUE(blob->Read(edge, 2, &read).ok()) << edge;
    EXPECT_EQ(read, bytes.substr(edge, 2));
  }
  EXPECT_FALSE(blob->Read(999'999, 2, &read).ok());
  EXPECT_FALSE(blob->Read(-1, 1, &read).ok());
}

TEST_P(BlobStoreTest, TakesFiles) {
  const TempDir elsewhere;
  const std::string bytes = RandomBytes(500'000, 4);
  for (int i = 0; i < 2; ++i) {
    PutFile(elsewhere.Path("upload"), bytes);
    // A directory wants the file on its own file system, where temporary folders are all.
    const absl::Status status = store_->PutFile(IdOf(bytes), elsewhere.Path("upload"));
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_FALSE(fs::exists(elsewhere.Path("upload")));
    EXPECT_TRUE(Read(*Another(), IdOf(bytes)) == bytes);
  }
  EXPECT_EQ(ReasonIn(store_->PutFile(IdOf("none"), elsewhere.Path("none"))), "BLOB_NOT_FOUND");
}

TEST_P(BlobStoreTest, EachTenantHasItsOwn) {
  ASSERT_TRUE(store_->Put(IdOf("same", "ann"), "same").ok());
  EXPECT_EQ(store_->Has(IdOf("same", "bob")).value(), false);
  ASSERT_TRUE(store_->Put(IdOf("same", "bob"), "same").ok());
  ASSERT_TRUE(store_->Put(IdOf("same", "ann"), "same").ok());
  EXPECT_THAT(Sizes(*Another()), ::testing::UnorderedElementsAre(::testing::Pair(IdOf("same", "ann"), 4),
                                                                 ::testing::Pair(IdOf("same", "bob"), 4)));
  EXPECT_EQ(store_->Remove(IdOf("same", "ann"), absl::ZeroDuration()).value(), true);
  EXPECT_EQ(Read(*Another(), IdOf("same", "ann")), "BLOB_NOT_FOUND");
  EXPECT_EQ(Read(*Another(), IdOf("same", "bob")), "same");
}

// A byte that changed, and a blob that was cut short.
TEST_P(BlobStoreTest, WhatIsDamagedCountsAsAbsentAndIsTakenAgain) {
  const std::string bytes = RandomBytes(700'000, 5);
  std::string changed = bytes;
  changed[400'000] = static_cast<char>(~changed[400'000]);
  for (const std::string& damage : {changed, bytes.substr(0, 300'000), std::string()}) {
    ASSERT_TRUE(store_->Put(IdOf(bytes), bytes).ok());
    place_->Replace(IdOf(bytes), damage);
    const auto other = Another();
    EXPECT_EQ(ReasonIn(other->Open(IdOf(bytes)).status()), "BLOB_DAMAGED");
    EXPECT_EQ(ReasonIn(other->Open(IdOf(bytes)).status()), "BLOB_NOT_FOUND");
    EXPECT_EQ(other->Has(IdOf(bytes)).value(), false);

    ASSERT_TRUE(other->Put(IdOf(bytes), bytes).ok());
    place_->Replace(IdOf(bytes), damage);
    EXPECT_EQ(ReasonIn(Another()->Load(IdOf(bytes)).status()), "BLOB_DAMAGED");

    ASSERT_TRUE(other->Put(IdOf(bytes), bytes).ok());
    place_->Replace(IdOf(bytes), damage);
    ASSERT_TRUE(Another()->Put(IdOf(bytes), bytes).ok()) << "good bytes replace damaged ones";
    EXPECT_TRUE(Read(*Another(), IdOf(bytes)) == bytes);
    EXPECT_EQ(store_->Remove(IdOf(bytes), absl::ZeroDuration()).value(), true);
  }
}

TEST_P(BlobStoreTest, OnlyWhatIsOldEnoughGoes) {
  const BlobId id = IdOf("young");
  ASSERT_TRUE(store_->Put(id, "young").ok());
  EXPECT_EQ(Another()->Remove(id, absl::Hours(1)).value(), false);
  EXPECT_EQ(Read(*store_, id), "young");
  place_->MakeOlder(id, absl::Hours(3));
  EXPECT_EQ(Another()->Remove(id, absl::Hours(4)).value(), false);
  EXPECT_EQ(Another()->Remove(id, absl::Hours(2)).value(), true);
  EXPECT_EQ(Read(*store_, id), "BLOB_NOT_FOUND");
}

// Whoever is about to refer to a blob that is there already makes it young again, by either call.
TEST_P(BlobStoreTest, WhatIsPutAgainOrRenewedIsYoung) {
  const BlobId id = IdOf("again");
  const auto age = [&] {
    absl::Duration found = absl::InfiniteDuration();
    EXPECT_TRUE(Another()->List([&](const BlobEntry& entry) { found = entry.age; }).ok());
    return found;
  };
  ASSERT_TRUE(store_->Put(id, "again").ok());
  EXPECT_LT(age(), absl::Minutes(1));
  for (const bool renew : {false, true}) {
    place_->MakeOlder(id, absl::Hours(3));
    EXPECT_GT(age(), absl::Hours(2));
    if (renew) {
      EXPECT_EQ(Another()->Renew(id).value(), true);
    } else {
      ASSERT_TRUE(Another()->Put(id, "again").ok());
    }
    EXPECT_LT(age(), absl::Minutes(1));
    EXPECT_EQ(store_->Remove(id, absl::Hours(2)).value(), false);
    EXPECT_EQ(Read(*store_, id), "again");
    EXPECT_THAT(Sizes(*store_), ::testing::SizeIs(1));
  }
  EXPECT_EQ(store_->Remove(id, absl::ZeroDuration()).value(), true);
  EXPECT_EQ(Read(*Another(), id), "BLOB_NOT_FOUND");
}

TEST_P(BlobStoreTest, CollectingKeepsWhatIsUsedOrYoung) {
  for (const char* bytes : {"used", "unused", "young"}) ASSERT_TRUE(store_->Put(IdOf(bytes), bytes).ok());
  for (const char* bytes : {"used", "unused"}) place_->MakeOlder(IdOf(bytes), absl::Hours(3));
  std::vector<BlobId> asked;
  const absl::StatusOr<std::int64_t> removed = CollectBlobs(
      Another().get(), absl::Hours(2), [&](const BlobId& id) -> absl::StatusOr<bool> {
        asked.push_back(id);
        return id == IdOf("used");
      });
  ASSERT_TRUE(removed.ok()) << removed.status();
  EXPECT_EQ(*removed, 1);
  EXPECT_THAT(asked, ::testing::UnorderedElementsAre(IdOf("used"), IdOf("unused")));
  EXPECT_THAT(Sizes(*store_), ::testing::UnorderedElementsAre(::testing::Key(IdOf("used")), ::testing::Key(IdOf("young"))));
  EXPECT_EQ(CollectBlobs(store_.get(), absl::Hours(2), [](const BlobId&) {
              return absl::StatusOr<bool>(absl::UnavailableError("the database is away"));
            }).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(store_->Has(IdOf("used")).value(), true) << "nothing goes that nobody could be asked about";
}

TEST_P(BlobStoreTest, ManyAreListed) {
  std::map<BlobId, std::int64_t> expected;
  for (int i = 0; i < 40; ++i) {
    const std::string bytes(static_cast<std::size_t>(i), 'x');
    const BlobId id = IdOf(bytes, i % 3 == 0 ? "ann" : "bob-2");
    ASSERT_TRUE(store_->Put(id, bytes).ok());
    expected[id] = i;
  }
  EXPECT_EQ(Sizes(*Another()), expected);
}

// Two stores in one place, with threads, put, renew, read and remove the same few blobs. Whoever put or renewed one
// finds it, since all of them are too young to go; what is read is right.
TEST_P(BlobStoreTest, TwoStoresAtTheSameTime) {
  const auto other = Neighbour();
  std::vector<std::string> blobs;
  for (unsigned i = 0; i < 3; ++i) blobs.push_back(RandomBytes(300'000, 10 + i));
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      BlobStore& store = t % 2 == 0 ? *store_ : *other;
      std::mt19937 random(t);
      for (int i = 0; i < 12; ++i) {
        const std::string& bytes = blobs[random() % blobs.size()];
        const absl::Status put = store.Put(IdOf(bytes), bytes);
        EXPECT_TRUE(put.ok()) << put;
        const absl::StatusOr<bool> removed = store.Remove(IdOf(bytes), absl::Minutes(30));
        EXPECT_TRUE(removed.ok()) << removed.status();
        EXPECT_FALSE(removed.value_or(true));
        EXPECT_EQ(store.Renew(IdOf(bytes)).value_or(false), true);
        EXPECT_TRUE(Read(store, IdOf(bytes)) == bytes);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(Sizes(*store_).size(), 3u);
}

// The deadly order of events: one process found the blob old and unused, another one puts it again.
TEST_P(BlobStoreTest, PuttingAgainAndRemovingTheOldOne) {
  const std::string bytes = RandomBytes(100'000, 20);
  const auto other = Neighbour();
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(store_->Put(IdOf(bytes), bytes).ok());
    place_->MakeOlder(IdOf(bytes), absl::Hours(3));
    std::thread remover([&] {
      const absl::StatusOr<bool> removed = other->Remove(IdOf(bytes), absl::Hours(2));
      EXPECT_TRUE(removed.ok()) << removed.status();
    });
    const absl::Status put = store_->Put(IdOf(bytes), bytes);
    remover.join();
    ASSERT_TRUE(put.ok()) << put;
    EXPECT_TRUE(Read(*other, IdOf(bytes)) == bytes) << i;
    EXPECT_EQ(other->Remove(IdOf(bytes), absl::Hours(2)).value(), false);
  }
}

template <class Place, class... Arguments>
std::function<std::unique_ptr<StorePlace>()> PlaceOf(Arguments... arguments) {
  return [=] { return std::make_unique<Place>(arguments...); };
}

INSTANTIATE_TEST_SUITE_P(Files, BlobStoreTest,
                         ::testing::Values(Engine{"Directory", PlaceOf<DirectoryPlace>(false)},
                                           Engine{"SharedDirectory", PlaceOf<DirectoryPlace>(true)}),
                         [](const auto& engine) { return std::string(engine.param.name); });
INSTANTIATE_TEST_SUITE_P(Postgres, BlobStoreTest, ::testing::Values(Engine{"Rows", PlaceOf<PostgresPlace>()}),
                         [](const auto& engine) { return std::string(engine.param.name); });
INSTANTIATE_TEST_SUITE_P(S3, BlobStoreTest,
                         ::testing::Values(Engine{"Objects", PlaceOf<S3Place>(),
                                                  [] { return S3Place::Server().why_not(); }}),
                         [](const auto& engine) { return std::string(engine.param.name); });

}  // namespace
}  // namespace planish
