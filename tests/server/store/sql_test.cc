// What verbs are made of: rows that go together, and calls that go together.
#include "server/store/sql.h"

#include <algorithm>
#include <deque>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/jobs/claim_pace.h"
#include "server/store/call_groups.h"
#include "tests/server/store/job_store_fixture.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// ---- RowBatch

// Remembers statements; each answers with the number of its values.
class Recorder : public SqlConnection {
 public:
  absl::Status Begin(Durability) override { return absl::OkStatus(); }
  absl::Status Commit() override { return absl::OkStatus(); }
  void Rollback() override {}
  absl::Status Serialize(const std::vector<std::string>&) override { return absl::OkStatus(); }
  absl::StatusOr<bool> TrySerialize(std::string_view) override { return true; }
  absl::StatusOr<SqlRows> Run(const std::string& sql, const std::vector<SqlValue>& values) override {
    statements.push_back(sql);
    SqlRows rows;
    rows.Add({{static_cast<std::int64_t>(values.size()), ""}});
    for (const SqlValue& value : values) {
      if (const auto* text = std::get_if<std::string_view>(&value)) texts.emplace_back(*text);
    }
    return rows;
  }

  std::vector<std::string> statements, texts;
};

TEST(RowBatch, GoesByFewStatementsOfFewSizes) {
  Recorder sql;
  RowBatch batch = RowBatch::Of("INSERT INTO t VALUES {rows}");
  ASSERT_TRUE(batch.Send(&sql).ok());
  EXPECT_THAT(sql.statements, IsEmpty());
  std::vector<std::string> expected;
  for (int i = 0; i < 16 + 4 + 2 + 1; ++i) {
    const std::string value = std::to_string(i);  // gone before the batch is sent
    batch.Add({std::string_view(value), std::int64_t{i}});
    expected.push_back(value);
  }
  std::deque<SqlRows> answers;
  ASSERT_TRUE(batch.Send(&sql, &answers).ok());
  ASSERT_THAT(sql.statements, SizeIs(4));
  EXPECT_EQ(sql.statements[2], "INSERT INTO t VALUES (?, ?), (?, ?)");
  EXPECT_EQ(sql.statements[3], "INSERT INTO t VALUES (?, ?)");
  EXPECT_EQ(sql.texts, expected) << "in the order in which they were added";
  std::vector<std::int64_t> sizes;
  for (const SqlRows& rows : answers) sizes.push_back(rows.Int(0, 0));
  EXPECT_THAT(sizes, ElementsAre(32, 8, 4, 2));
  ASSERT_TRUE(batch.Send(&sql).ok());
  EXPECT_THAT(sql.statements, SizeIs(4)) << "what was sent is forgotten";
}

TEST(RowBatch, SaysWhatEachKindSays) {
  Recorder sql;
  RowBatch update = RowBatch::Update("t", {"a", "b"}, "k");
  RowBatch select = RowBatch::Select("SELECT * FROM (SELECT a FROM t WHERE k = ? LIMIT ?) AS s");
  for (const int rows : {1, 2}) {
    for (int i = 0; i < rows; ++i) {
      update.Add({1, 2, 3});
      select.Add({1, 2});
    }
    ASSERT_TRUE(update.Send(&sql).ok());
    ASSERT_TRUE(select.Send(&sql).ok());
  }
  EXPECT_THAT(
      sql.statements,
      ElementsAre("UPDATE t SET a = ?, b = ? WHERE k = ?", "SELECT * FROM (SELECT a FROM t WHERE k = ? LIMIT ?) AS s",
                  "UPDATE t SET a = v.column1, b = v.column2 FROM (VALUES (?, ?, ?), (?, ?, ?)) AS v WHERE k = "
                  "v.column3",
                  "SELECT * FROM (SELECT a FROM t WHERE k = ? LIMIT ?) AS s UNION ALL "
                  "SELECT * FROM (SELECT a FROM t WHERE k = ? LIMIT ?) AS s"));
}

TEST_P(JobStoreTest, RowsGoTogetherAsOneByOne) {
  const std::unique_ptr<SqlDatabase> database = OpenDatabase();
  const SqlDatabase::Lease sql = *database->Connect(SqlDatabase::Use::kWrite);
  const auto run = [&sql](const std::string& statement) {
    const auto rows = sql->Run(statement, {});
    EXPECT_TRUE(rows.ok()) << rows.status();
    return *rows;
  };
  run("CREATE TABLE t (k BIGINT PRIMARY KEY, a TEXT, b BIGINT)");
  constexpr std::int64_t kRows = 37;
  RowBatch insert = RowBatch::Of("INSERT INTO t (k, a, b) VALUES {rows}");
  RowBatch update = RowBatch::Update("t", {"a", "b"}, "k");
  RowBatch select = RowBatch::Select("SELECT * FROM (SELECT k, a, b FROM t WHERE k >= ? ORDER BY k LIMIT ?) AS s");
  RowBatch remove = RowBatch::Of("DELETE FROM t WHERE k IN ({rows})");
  ASSERT_TRUE(sql->Begin(Durability::kLater).ok());
  for (std::int64_t k = 0; k < kRows; ++k) {
    insert.Add({k, std::string_view("new"), std::int64_t{0}});
    const std::string text = std::to_string(k);
    if (k % 2 == 0) update.Add({std::string_view(text), 10 * k, k});
    if (k % 5 == 0) remove.Add({k});
    select.Add({k, std::int64_t{1}});
  }
  for (RowBatch* const batch : {&insert, &update, &remove}) ASSERT_TRUE(batch->Send(sql.get()).ok());
  std::deque<SqlRows> answers;
  ASSERT_TRUE(select.Send(sql.get(), &answers).ok());
  ASSERT_TRUE(sql->Commit().ok());
  std::int64_t asked = 0;
  for (const SqlRows& rows : answers) {
    for (std::size_t i = 0; i < rows.size(); ++i, ++asked) {
      const std::int64_t k = asked % 5 == 0 ? asked + 1 : asked;
      EXPECT_EQ(rows.Int(i, 0), k);
      EXPECT_EQ(rows.Bytes(i, 1), k % 2 == 0 ? std::to_string(k) : "new");
      EXPECT_EQ(rows.Int(i, 2), k % 2 == 0 ? 10 * k : 0);
    }
  }
  EXPECT_EQ(asked, kRows);
  insert.Add({std::int64_t{1}, std::string_view("again"), std::int64_t{0}});
  EXPECT_TRUE(absl::IsInternal(insert.Send(sql.get()))) << "a key that is taken is a bug";
  sql->Rollback();
  run("DROP TABLE t");
}

// ---- CallGroups

struct Call {
  std::string name;
  std::vector<std::string> keys;
};

TEST(CallGroups, WhatComesMeanwhileGoesTogether) {
  CallGroups<Call> groups(/*most_groups=*/1, /*most_calls=*/3);
  std::mutex mutex;
  std::vector<std::string> done;  // the names of each group
  std::condition_variable changed;
  bool goes_on = false;
  const auto body = [&](const std::vector<Call*>& calls) {
    std::unique_lock lock(mutex);
    std::string& names = done.emplace_back();
    for (const Call* call : calls) names += call->name;
    changed.notify_all();
    changed.wait(lock, [&] { return goes_on; });
  };
  std::vector<std::thread> threads;
  std::atomic<int> returned = 0;
  const auto call = [&](const std::string& name, const std::string& key) {
    threads.emplace_back([&, own = Call{name, {key}}]() mutable {
      groups.Run(&own, body);
      ++returned;
    });
  };
  call("a", "1");
  {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return !done.empty(); });
  }
  const std::vector<std::pair<std::string, std::string>> others = {
      {"b", "1"}, {"c", "2"}, {"d", "2"}, {"e", "3"}, {"f", "4"}};
  for (std::size_t i = 0; i < others.size(); ++i) {
    call(others[i].first, others[i].second);
    ASSERT_TRUE(WaitUntil([&] { return groups.waiting() == i + 1; }));
  }
  EXPECT_EQ(returned, 0);
  {
    const std::lock_guard lock(mutex);
    EXPECT_THAT(done, ElementsAre("a")) << "one group at a time";
    goes_on = true;
  }
  changed.notify_all();
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(done, ElementsAre("a", "bce", "df")) << "three at most, in their order, no two of one key";
}

TEST(CallGroups, SeveralGroupsGoAtTheSameTime) {
  CallGroups<Call> groups(/*most_groups=*/2, /*most_calls=*/16);
  std::atomic<int> inside = 0;
  std::atomic<int> met = 0;
  const auto run = [&](Call call) {
    groups.Run(&call, [&](const std::vector<Call*>&) {
      ++inside;
      met += WaitUntil([&] { return inside == 2; });
    });
  };
  std::thread other([&] { run({"a", {}}); });
  ASSERT_TRUE(WaitUntil([&] { return inside == 1; }));
  run({"b", {}});
  other.join();
  EXPECT_EQ(met, 2) << "each saw the other inside";
}

// ---- ClaimPace

class ClaimPaceTest : public ::testing::Test {
 protected:
  // The rests after so many claims that queued so long.
  std::vector<absl::Duration> RestsAfter(absl::Duration queued, int claims) {
    std::vector<absl::Duration> rests;
    for (int i = 0; i < claims; ++i) rests.push_back(pace_.Next(now_, interval_, queued) - now_);
    return rests;
  }
  absl::Duration RestAfter(absl::Duration queued) { return RestsAfter(queued, 1)[0]; }

  const absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  const absl::Duration interval_ = absl::Milliseconds(800);
  ClaimPace pace_{"a"};
};

TEST_F(ClaimPaceTest, RestsTheLongerTheLongerClaimsQueue) {
  EXPECT_EQ(pace_.Next(now_, absl::ZeroDuration(), absl::Seconds(1)), now_) << "few servers do not rest";
  for (const absl::Duration rest : RestsAfter(absl::Milliseconds(2), 10)) {
    EXPECT_GT(rest, absl::ZeroDuration());
    EXPECT_LE(rest, interval_) << "a database that has time is asked in each interval";
  }
  RestAfter(absl::Milliseconds(17));
  const std::vector<absl::Duration> rests = RestsAfter(absl::Milliseconds(17), 20);
  const auto [least, most] = std::minmax_element(rests.begin(), rests.end());
  EXPECT_GT(*least, absl::Seconds(1));
  EXPECT_LE(*most, absl::Seconds(5) + interval_);
  EXPECT_GT(*most - *least, absl::Seconds(1)) << "servers that rest at the same time do not come back together";
}

TEST_F(ClaimPaceTest, OneSlowClaimSaysNothing) {
  RestsAfter(absl::ZeroDuration(), 3);
  EXPECT_LE(RestAfter(absl::Seconds(2)), interval_);
  EXPECT_LE(RestAfter(absl::ZeroDuration()), interval_);
  EXPECT_GT(RestAfter(absl::Seconds(2)), absl::Seconds(2)) << "two of three do";
}

TEST_F(ClaimPaceTest, DatabaseThatWasBusyIsAskedAgainSoon) {
  for (const absl::Duration rest : RestsAfter(absl::Seconds(30), 100)) EXPECT_LE(rest, absl::Seconds(6) + interval_);
  RestAfter(absl::ZeroDuration());
  EXPECT_LE(RestAfter(absl::ZeroDuration()), interval_);
}

// Always at its own place in the interval, which another server does not share.
TEST_F(ClaimPaceTest, EachServerHasAPlaceOfItsOwn) {
  ClaimPace other("b");
  const auto place = [&](ClaimPace& of, absl::Duration took) {
    return (of.Next(now_, interval_, took) - absl::UnixEpoch()) % interval_;
  };
  const absl::Duration first = place(pace_, absl::Milliseconds(1));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(place(pace_, absl::Milliseconds(33)), first);
  EXPECT_NE(place(other, absl::Milliseconds(1)), first);
}

}  // namespace
}  // namespace planish
