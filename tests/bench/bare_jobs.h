// Bare SQL that writes what the store writes.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/bench/farm_load.h"

namespace planish::bench {

// The same rows as those of the store, in tables of the same definition, by SQL that knows beforehand what to write:
// what is left is what the store has to read and to decide. An accept and a finish are a durable transaction each,
// since somebody is told of each; 16 jobs are claimed, and 100 deleted, by one transaction. The jobs that are claimed
// are those that have waited longest, and statements are prepared, hold up to 16 rows, and travel together, as those of
// the store.
class BareJobs {
 public:
  explicit BareJobs(const Flags& flags) : flags_(flags) {
    Connection sql(flags.url);
    sql.Run("SET client_min_messages = warning");
    sql.Run("DROP SEQUENCE IF EXISTS bare_numbers");
    sql.Run("CREATE SEQUENCE bare_numbers");
    for (const std::string table : {"jobs", "works", "events", "labels", "tenants"}) {
      sql.Run("DROP TABLE IF EXISTS bare_" + table);
      sql.Run(absl::StrCat("CREATE TABLE bare_", table, " (LIKE ", table, " INCLUDING ALL)"));
      const SqlRows options = sql.Run(
          "SELECT coalesce(array_to_string(reloptions, ', '), '') FROM pg_class WHERE oid = CAST(CAST(? AS TEXT) AS "
          "REGCLASS)",
          {std::string_view(table)});
      const std::string settings = options.Bytes(0, 0);  // fillfactor
      if (!settings.empty()) sql.Run(absl::StrCat("ALTER TABLE bare_", table, " SET (", settings, ")"));
    }
    // Those that wait.
    sql.Run(
        "INSERT INTO bare_works SELECT 'jobs/' || substr(md5(CAST(i AS TEXT)), 1, 16), 'tenant' || i % ?, "
        "nextval('bare_numbers'), 0, i, 100000000, 100000, 3000000000, 0, 0, '', 0, 0, 0, 0, 1000000 "
        "FROM generate_series(1, ?) AS i",
        {flags.tenants, flags.waiting});
    sql.Run(
        "INSERT INTO bare_jobs (number, name, tenant, request_id, state, priority, ended, end_time, work_key, "
        "mesh_sha256, "
        "elements_sha256, uv_sha256, record, report, create_time, work, due) SELECT number, name, tenant, "
        "md5(name), 1, 0, 0, 0, CAST('key of ' || name AS BYTEA), CAST(name AS BYTEA), '', '', ?, '', number, name, "
        "9223372036854775807 FROM bare_works ORDER BY number",
        {SqlBytes{record_}});
    sql.Run("INSERT INTO bare_labels SELECT number, 'asset', 'crate' FROM bare_works ORDER BY number");
    sql.Run("INSERT INTO bare_events SELECT number, 1, 1, ? FROM bare_works ORDER BY number", {SqlBytes{record_}});
    for (const std::string table : {"jobs", "works", "events", "labels"}) sql.Run("ANALYZE bare_" + table);
    const SqlRows rows = sql.Run("SELECT number, name, tenant FROM bare_works ORDER BY number");
    for (std::size_t i = 0; i < rows.size(); ++i) {
      waiting_.push_back({rows.Int(i, 0), rows.Bytes(i, 1), rows.Bytes(i, 2)});
    }
  }

  double JobsPerSecond() {
    std::atomic<int> accepted = 0;
    Crowd crowd;
    for (int i = 0; i < flags_.fronts; ++i) {
      crowd.Add([&] {
        Connection sql(flags_.url);
        while (!over_) {
          if (accepted++ < finished_ + flags_.fronts) {
            Accept(&sql);
          } else {
            --accepted;
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
          }
        }
      });
      crowd.Add([&] {
        Connection sql(flags_.url);
        while (!over_) {
          for (const Row& row : Claim(&sql)) {
            if (!over_) Finish(&sql, row);
          }
        }
      });
    }
    crowd.Add([&] {
      Connection sql(flags_.url);
      while (!over_) {
        if (!Delete(&sql)) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
    });
    const auto wait_for = [this](int jobs) {
      while (finished_ < jobs) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    };
    wait_for(flags_.jobs / 10);  // until then all connections have prepared what they need
    const int before = finished_;
    const Clock::time_point start = Clock::now();
    wait_for(before + flags_.jobs);
    const double rate = (finished_ - before) / Since(start);
    over_ = true;
    return rate;
  }

 private:
  struct Row {
    std::int64_t number = 0;
    std::string name, tenant;
  };
  // What becomes of the account of a tenant.
  struct Account {
    std::int64_t waiting = 0, running = 0, ended = 0;
  };
  using Accounts = std::map<std::string, Account>;

  static RowBatch Events() {
    return RowBatch::Of("INSERT INTO bare_events (job, sequence, event, kind) VALUES {rows}");
  }

  void AddEvent(const Row& row, std::int64_t sequence, RowBatch* events) const {
    events->Add({row.number, sequence, SqlBytes{record_}, std::int64_t{1}});
  }

  void Write(Connection* sql, const Accounts& accounts) const {
    if (!flags_.bare_accounts) return;
    RowBatch sums = RowBatch::Of(
        "INSERT INTO bare_tenants AS t VALUES {rows} ON CONFLICT (tenant, slot) DO UPDATE SET "
        "waiting = t.waiting + excluded.waiting, waiting_bytes = t.waiting_bytes + excluded.waiting_bytes, "
        "running = t.running + excluded.running, started = t.started + excluded.started, "
        "charged = t.charged + excluded.charged, received = t.received + excluded.received, "
        "ended = t.ended + excluded.ended, result_bytes = t.result_bytes + excluded.result_bytes");
    for (const auto& [tenant, account] : accounts) {
      sums.Add({std::string_view(tenant), sql->Slot(), account.waiting, account.waiting * 100'000, account.running,
                account.running * 1'000'000, account.running * 1'000'000, account.ended, account.ended,
                account.ended * 480'000});
    }
    sql->Send(&sums);
  }

  void Accept(Connection* sql) {
    Row row;
    const std::string id = RandomId();
    row.name = "jobs/" + id;
    row.tenant = Tenant(static_cast<int>(next_tenant_++ % flags_.tenants));
    const std::string key = "key of " + row.name;
    sql->Begin(Durability::kNow);
    row.number =
        sql->Run(
               "INSERT INTO bare_jobs (number, name, tenant, request_id, state, priority, ended, end_time, work_key, "
               "mesh_sha256, elements_sha256, uv_sha256, record, report, create_time, work, due) VALUES "
               "(nextval('bare_numbers'), ?, ?, ?, 1, 0, 0, 0, ?, ?, '', '', ?, '', ?, ?, "
               "9223372036854775807) RETURNING number",
               {std::string_view(row.name), std::string_view(row.tenant), std::string_view(id), SqlBytes{key},
                SqlBytes{row.name}, SqlBytes{record_}, absl::ToUnixNanos(absl::Now()), std::string_view(row.name)})
            .Int(0, 0);
    sql->Send("INSERT INTO bare_labels VALUES (?, 'asset', 'crate')", {row.number});
    sql->Send(
        "INSERT INTO bare_works (name, tenant, number, running, turn_time, memory_bytes, mesh_bytes, run_time, alone, "
        "wish, owner, attempt, lease_until, start_time, charge, share) VALUES (?, ?, ?, 0, ?, 100000000, 100000, "
        "3000000000, 0, 0, '', 0, 0, 0, 0, 1000000)",
        {std::string_view(row.name), std::string_view(row.tenant), row.number, absl::ToUnixNanos(absl::Now())});
    RowBatch events = Events();
    AddEvent(row, 1, &events);
    sql->Send(&events);
    Write(sql, {{row.tenant, {1, 0, 0}}});
    sql->Commit();
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(row));
  }

  // Up to 16 jobs.
  std::vector<Row> Claim(Connection* sql) {
    const std::vector<Row> rows = Take(&waiting_, 16);
    RowBatch jobs = RowBatch::Update("bare_jobs", {"state", "record"}, "number");
    RowBatch works = RowBatch::Update("bare_works",
                                      {"number", "running", "turn_time", "alone", "wish", "owner", "attempt",
                                       "lease_until", "start_time", "charge", "share"},
                                      "name");
    RowBatch events = Events();
    Accounts accounts;
    const std::int64_t now = absl::ToUnixNanos(absl::Now());
    for (const Row& row : rows) {
      jobs.Add({std::int64_t{2}, SqlBytes{record_}, row.number});
      works.Add({row.number, std::int64_t{1}, now, std::int64_t{0}, std::int64_t{0}, std::string_view("machine"),
                 std::int64_t{1}, now, now, std::int64_t{1}, std::int64_t{1}, std::string_view(row.name)});
      AddEvent(row, 2, &events);
      accounts[row.tenant].waiting -= 1;
      accounts[row.tenant].running += 1;
    }
    accounts[""];  // the virtual time
    sql->Begin(Durability::kLater);
    for (RowBatch* const batch : {&jobs, &events, &works}) sql->Send(batch);
    Write(sql, accounts);
    sql->Commit();
    return rows;
  }

  void Finish(Connection* sql, const Row& row) {
    sql->Begin(Durability::kNow);
    sql->Send(
        "UPDATE bare_jobs SET state = 4, record = ?, ended = 1, end_time = ?, uv_sha256 = ?, uv_bytes = 480000, "
        "report = ? WHERE number = ?",
        {SqlBytes{record_}, absl::ToUnixNanos(absl::Now()), SqlBytes{uv_}, SqlBytes{report_}, row.number});
    RowBatch events = Events();
    AddEvent(row, 3, &events);
    sql->Send(&events);
    sql->Send("DELETE FROM bare_works WHERE name = ?", {std::string_view(row.name)});
    Write(sql, {{row.tenant, {0, -1, 1}}});
    sql->Commit();
    ++finished_;
    const std::lock_guard lock(mutex_);
    ended_.push_back(row);
  }

  // Up to 100 jobs; whether there were any.
  bool Delete(Connection* sql) {
    const std::vector<Row> rows = Take(&ended_, 100);
    if (rows.empty()) return false;
    Accounts accounts;
    for (const Row& row : rows) accounts[row.tenant].ended -= 1;
    sql->Begin(Durability::kLater);
    for (const std::string from : {"bare_events WHERE job", "bare_labels WHERE job", "bare_jobs WHERE number"}) {
      RowBatch batch = RowBatch::Of("DELETE FROM " + from + " IN ({rows})");
      for (const Row& row : rows) batch.Add({row.number});
      sql->Send(&batch);
    }
    Write(sql, accounts);
    sql->Commit();
    return true;
  }

  std::vector<Row> Take(std::deque<Row>* from, std::size_t most) {
    const std::lock_guard lock(mutex_);
    const auto end = from->begin() + static_cast<std::ptrdiff_t>(std::min(most, from->size()));
    std::vector<Row> rows(from->begin(), end);
    from->erase(from->begin(), end);
    return rows;
  }

  const Flags& flags_;
  const std::string record_ = MakeJob("tenant0").record.SerializeAsString();
  const std::string report_ = Success().report.SerializeAsString();
  const std::string uv_ = Success().uv.uv_sha256();
  std::atomic<bool> over_ = false;
  std::atomic<int> finished_ = 0;
  std::atomic<unsigned> next_tenant_ = 0;

  std::mutex mutex_;
  std::deque<Row> waiting_, ended_;  // guarded by mutex_
};

}  // namespace planish::bench
