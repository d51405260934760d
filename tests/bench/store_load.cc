// planish_store_load URL [flags]: how many jobs a second one PostgreSQL takes from Accept() to Finish(), beside bare
// SQL that writes the same rows in as many transactions; one JSON object per measurement on stdout. `tests/bench/run.sh
// farm` starts a PostgreSQL for it. The database must be empty. Nothing is unwrapped: workers end at once what they
// claim.
//
//   "fill"       jobs a second while as many jobs as are to wait are accepted
//   "saturated"  machines claim in batches, finish, renew, and look for the jobs of others; fronts accept as many as
//                end; old jobs are deleted; from time to time a job of a tenant that has nothing waits for its claim
//   "steady"     the same with workers that take their time, so that they can end half of what bare SQL does (--load):
//                what the store is promised to take
//   "light"      the same with half of that
//   "bare"       the same rows by SQL that knows beforehand what to write (BareJobs)
//   "machines"   jobs a second of one machine and of many whose workers sleep
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "nlohmann/json.hpp"
#include "server/jobs/claim_pace.h"
#include "server/store/ids.h"
#include "server/store/job_store.h"
#include "server/store/lifecycle.h"

namespace planish::bench {
namespace {

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Flags {
  std::string url;
  int machines = 200;
  int slots = 16;         // workers of a machine
  int waiting = 100'000;  // jobs that wait all the time
  int tenants = 20;
  int fronts = 16;    // threads that accept
  int jobs = 20'000;  // that are finished in one round
  int rounds = 3;
  std::vector<std::string> kinds = {"saturated", "steady", "light"};
  double load = 0.5;  // of what bare SQL takes: the jobs a second that the workers of "steady" can end
  bool bare_accounts = true;
  double worker_seconds = 3;
  int sleeping_machines = 50;
  double sleeping_seconds = 15;  // that each of the two measurements of "machines" takes
};

// A value, or the end of the program.
template <typename T>
T Get(absl::StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(std::string(result.status().message()));
  return *std::move(result);
}

// One of so many machines, or their front.
std::unique_ptr<JobStore> OpenStore(const Flags& flags, int machines, int connections, bool must_hear) {
  PostgresOptions options;
  options.url = flags.url;
  options.connections = connections;
  options.must_hear = must_hear;
  std::unique_ptr<SqlDatabase> opened = Get(OpenPostgresDatabase(options));
  SqlDatabase* const database = opened.get();
  std::unique_ptr<JobStore> store = NewJobStore(std::move(opened));
  database->SetProcesses(machines + 1, 1);
  Get(store->Find(""));  // makes the first connection: not all machines at once
  return store;
}

VerbContext Now() {
  VerbContext context;
  context.now = absl::Now();
  return context;
}

// About what a real record has.
NewJob MakeJob(const std::string& tenant) {
  NewJob job;
  v1::Job* const described = job.record.mutable_job();
  described->set_name("jobs/" + RandomId());
  described->set_state(v1::JOB_STATE_QUEUED);
  described->set_tenant(tenant);
  described->set_memory_bytes(100 << 20);
  described->set_mesh_bytes(100'000);
  (*described->mutable_labels())["asset"] = "crate";
  job.record.set_request_id(RandomId());
  job.record.set_work_key("key of " + described->name());
  job.record.set_mesh_sha256(described->name().substr(0, 32));
  job.record.set_reserved_sequence(1024);
  job.run_time = absl::Seconds(3);
  *described->mutable_create_time() = ToTimestamp(absl::Now());
  return job;
}

AttemptOutcome Success() {
  AttemptOutcome outcome;
  v1::Report* const report = &outcome.report;
  report->mutable_input()->set_triangles(20'000);
  for (int i = 0; i < 20; ++i) report->add_charts()->set_stop_message("converged after 3 Newton steps, and so on");
  outcome.uv.set_uv_sha256(std::string(32, 'u'));
  outcome.uv.set_total_bytes(480'000);
  return outcome;
}

class Latencies {
 public:
  void Add(double seconds) {
    const std::lock_guard lock(mutex_);
    seconds_.push_back(seconds);
  }
  void Clear() {
    const std::lock_guard lock(mutex_);
    seconds_.clear();
  }
  double At(double part) {
    const std::lock_guard lock(mutex_);
    if (seconds_.empty()) return 0;
    std::sort(seconds_.begin(), seconds_.end());
    return seconds_[std::min(seconds_.size() - 1, static_cast<std::size_t>(part * double(seconds_.size())))];
  }

 private:
  std::mutex mutex_;
  std::vector<double> seconds_;
};

// Threads whose first error ends the program.
class Crowd {
 public:
  ~Crowd() { Join(); }
  void Add(std::function<void()> body) {
    threads_.emplace_back([body = std::move(body)] {
      try {
        body();
      } catch (const std::exception& error) {
        std::fprintf(stderr, "planish_store_load: %s\n", error.what());
        std::_Exit(1);
      }
    });
  }
  void Join() {
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

 private:
  std::vector<std::thread> threads_;
};

// SQL by itself.
class Connection {
 public:
  explicit Connection(const std::string& url)
      : database_(Get(OpenPostgresDatabase({url, 1}))), sql_(Get(database_->Connect(SqlDatabase::Use::kWrite))) {}

  SqlRows Run(const std::string& sql, const std::vector<SqlValue>& values = {}) { return Get(sql_->Run(sql, values)); }
  // Without waiting for it.
  void Send(const std::string& sql, const std::vector<SqlValue>& values) { Check(sql_->RunLater(sql, values)); }
  void Send(RowBatch* batch) { Check(batch->Send(sql_.get())); }
  std::int64_t Slot() const { return sql_->Slot(); }
  void Begin(Durability durability) { Check(sql_->Begin(durability)); }
  void Commit() { Check(sql_->Commit()); }

 private:
  static void Check(const absl::Status& status) {
    if (!status.ok()) throw std::runtime_error(std::string(status.message()));
  }

  std::unique_ptr<SqlDatabase> database_;
  SqlDatabase::Lease sql_;
};

std::int64_t DatabaseBytes(const Flags& flags) {
  return Connection(flags.url).Run("SELECT pg_database_size(current_database())").Int(0, 0);
}

std::string Tenant(int number) {
  return absl::StrCat("tenant", number);
}

void Fill(const Flags& flags, int jobs) {
  const Clock::time_point start = Clock::now();
  std::atomic<int> left = jobs;
  {
    Crowd crowd;
    const std::shared_ptr<JobStore> store = OpenStore(flags, 1, flags.fronts, /*must_hear=*/true);
    for (int i = 0; i < flags.fronts; ++i) {
      crowd.Add([&left, &flags, store] {
        for (int n; (n = --left) >= 0;) Get(store->Accept(Now(), MakeJob(Tenant(n % flags.tenants))));
      });
    }
  }
  const double seconds = Since(start);
  std::printf("%s\n",
              nlohmann::json({{"bench", "fill"}, {"jobs", jobs}, {"jobs_per_second", jobs / seconds}}).dump().c_str());
  std::fflush(stdout);
}

struct Round {
  std::atomic<int> finished = 0, accepted = 0;
  std::atomic<bool> over = false;
  Latencies claims, waits, finishes, lone_starts;  // waits: of free workers
  std::mutex mutex;
  std::map<std::string, Clock::time_point> lone;  // jobs of the tenant that has no others
};

// What a machine does until the round is over, as JobRunner and JobManager do it: one thread claims what its free
// workers may take, as many as there are workers end jobs after `sleep` seconds, and one renews leases and looks for
// the jobs of others.
class Machine {
 public:
  Machine(const Flags& flags, int machines, std::string owner, double sleep, Round* round)
      : store_holder_(OpenStore(flags, machines, 2, /*must_hear=*/false)),
        store_(*store_holder_),
        owner_(std::move(owner)),
        machines_(machines),
        sleep_(sleep),
        round_(*round),
        free_(static_cast<std::size_t>(flags.slots), Clock::now()) {}

  void Claim() {
    const ClaimPace pace(owner_);
    const double interval = machines_ / kClaimsPerSecond;
    std::minstd_rand random(static_cast<unsigned>(std::hash<std::string>()(owner_)));
    std::uniform_real_distribution<double> jitter(0.5, 1.5);
    while (!round_.over) {
      ClaimRequest request;
      request.owner = owner_;
      request.lease = absl::Seconds(15);
      {
        std::unique_lock lock(mutex_);
        freed_.wait_for(lock, kLook, [&] { return !free_.empty(); });
        request.most = static_cast<int>(free_.size());
      }
      if (request.most == 0) continue;
      const Clock::time_point start = Clock::now();
      const std::vector<ClaimedWork> claimed = Get(store_.Claim(Now(), request));
      const double took = Since(start);
      round_.claims.Add(took);
      {
        const std::lock_guard lock(mutex_);
        for (const ClaimedWork& work : claimed) {
          round_.waits.Add(Since(free_.front()));
          free_.pop_front();
          ends_.emplace(After(sleep_ * jitter(random)), work.lease);
          running_[work.lease.work] = {work.lease, Clock::now()};
        }
      }
      given_.notify_all();
      for (const ClaimedWork& work : claimed) NoteLone(work.jobs[0].record.job());
      const absl::Time now = absl::Now();
      const absl::Time next = pace.Next(now, absl::Seconds(interval > 0.02 ? interval : 0), absl::Seconds(took));
      Pause(std::max(absl::ToDoubleSeconds(next - now), claimed.empty() ? 0.02 : 0));
    }
  }

  void Finish() {
    while (!round_.over) {
      Lease lease;
      {
        std::unique_lock lock(mutex_);
        const Clock::time_point look = Clock::now() + kLook;
        given_.wait_until(lock, ends_.empty() ? look : std::min(ends_.begin()->first, look));
        if (ends_.empty() || ends_.begin()->first > Clock::now()) continue;
        lease = std::move(ends_.begin()->second);
        ends_.erase(ends_.begin());
      }
      const Clock::time_point start = Clock::now();
      Get(store_.Finish(Now(), lease, Success()));
      round_.finishes.Add(Since(start));
      ++round_.finished;
      const std::lock_guard lock(mutex_);
      running_.erase(lease.work);
      free_.push_back(Clock::now());
      freed_.notify_one();
    }
  }

  void KeepOrder() {
    Clock::time_point renewed = Clock::now(), asked = renewed, looked = renewed;
    for (; Pause(0.5);) {
      std::vector<Lease> leases;
      if (Since(renewed) > kRenewals) {
        const std::lock_guard lock(mutex_);
        renewed = Clock::now();
        for (auto& [work, held] : running_) {
          if (Since(held.renewed) < kRenewals / 2) continue;
          held.renewed = renewed;
          leases.push_back(held.lease);
        }
      }
      if (!leases.empty()) Get(store_.Renew(leases, absl::Seconds(15)));
      if (Since(asked) > 1 && !store_.hears_others()) {
        Get(store_.Wishes(owner_));
        asked = Clock::now();
      }
      if (Since(looked) > machines_ / 20.0) {
        Get(store_.EndOverdue(Now(), 100));
        Get(store_.Reap(Now(), "", 100));
        looked = Clock::now();
      }
    }
  }

  void Leave() { Get(store_.Release(Now(), owner_)); }

 private:
  static constexpr std::chrono::seconds kLook{1};  // whether the round is over
  static constexpr double kRenewals = 3;           // seconds: a fifth of a lease of 15

  static Clock::time_point After(double seconds) {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  // False if the round is over.
  bool Pause(double seconds) const {
    const Clock::time_point end = After(seconds);
    while (!round_.over && Clock::now() < end) std::this_thread::sleep_until(std::min(end, Clock::now() + kLook));
    return !round_.over;
  }

  void NoteLone(const v1::Job& job) {
    if (job.tenant() != "lone") return;
    const std::lock_guard lock(round_.mutex);
    const auto found = round_.lone.find(job.name());
    if (found != round_.lone.end()) round_.lone_starts.Add(Since(found->second));  // not one of an earlier round
  }

  const std::unique_ptr<JobStore> store_holder_;
  JobStore& store_;
  const std::string owner_;
  const int machines_;
  const double sleep_;
  Round& round_;

  std::mutex mutex_;
  std::condition_variable freed_, given_;
  struct Held {
    Lease lease;
    Clock::time_point renewed;
  };
  // Guarded by mutex_.
  std::deque<Clock::time_point> free_;            // workers, since when each
  std::multimap<Clock::time_point, Lease> ends_;  // of what runs, but for what is being finished
  std::map<std::string, Held> running_;           // by work
};

// Machines and the threads of each. Ends with the round.
class Machinery {
 public:
  // Workers take `sleep` seconds a job, more or less. The machines begin one after the other within `stagger` seconds.
  Machinery(const Flags& flags, int machines, double sleep, double stagger, Round* round) {
    for (int i = 0; i < machines; ++i) {
      machines_.push_back(std::make_unique<Machine>(flags, machines, absl::StrCat("machine", i), sleep, round));
    }
    for (int i = 0; i < machines; ++i) {
      Machine* const machine = machines_[std::size_t(i)].get();
      crowd_.Add([machine, stagger, i, machines] {
        std::this_thread::sleep_for(std::chrono::duration<double>(stagger * i / machines));
        machine->Claim();
      });
      crowd_.Add([machine] { machine->KeepOrder(); });
      for (int slot = 0; slot < flags.slots; ++slot) crowd_.Add([machine] { machine->Finish(); });
    }
  }
  ~Machinery() {
    crowd_.Join();
    for (const std::unique_ptr<Machine>& machine : machines_) machine->Leave();
  }

 private:
  std::vector<std::unique_ptr<Machine>> machines_;
  Crowd crowd_;
};

nlohmann::json Store(const Flags& flags, const std::string& name, double sleep, int jobs) {
  Round round;
  const std::unique_ptr<JobStore> front = OpenStore(flags, flags.machines, flags.fronts + 2, /*must_hear=*/true);
  std::optional<Machinery> machinery(std::in_place, flags, flags.machines, sleep, /*stagger=*/sleep, &round);
  Crowd crowd;
  for (int i = 0; i < flags.fronts; ++i) {
    crowd.Add([&] {
      while (!round.over) {
        if (round.accepted >= round.finished) {
          std::this_thread::sleep_for(std::chrono::milliseconds(2));
          continue;
        }
        const int n = ++round.accepted;
        Get(front->Accept(Now(), MakeJob(Tenant(n % flags.tenants))));
      }
    });
  }
  crowd.Add([&] {
    while (!round.over) {
      const NewJob job = MakeJob("lone");
      {
        const std::lock_guard lock(round.mutex);
        round.lone[job.record.job().name()] = Clock::now();
      }
      Get(front->Accept(Now(), job));
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
  });
  // Retention: as many jobs go as end.
  std::atomic<int> deleted = 0;
  crowd.Add([&] {
    while (!round.over) {
      if (deleted >= round.finished) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        continue;
      }
      deleted += static_cast<int>(Get(front->DeleteOldest("", std::min(100, round.finished - deleted))).size());
    }
  });
  // From when all machines are at it: their connections have prepared what they need, and jobs end one after the other.
  std::this_thread::sleep_for(std::chrono::duration<double>(2 * sleep));
  const int warm = round.finished + 40 * flags.machines;
  while (round.finished < warm) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  for (Latencies* const each : {&round.claims, &round.waits, &round.finishes, &round.lone_starts}) each->Clear();
  const int before = round.finished;
  const Clock::time_point start = Clock::now();
  while (round.finished < before + jobs) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const double seconds = Since(start);
  const int finished = round.finished - before;
  round.over = true;
  crowd.Join();
  machinery.reset();
  return {{"bench", name},
          {"worker_seconds", sleep},
          {"machines", flags.machines},
          {"slots", flags.slots},
          {"waiting", flags.waiting},
          {"jobs", finished},
          {"jobs_per_second", finished / seconds},
          {"claim_p50_seconds", round.claims.At(0.5)},
          {"claim_p99_seconds", round.claims.At(0.99)},
          {"wait_p50_seconds", round.waits.At(0.5)},
          {"finish_p99_seconds", round.finishes.At(0.99)},
          {"lone_start_max_seconds", round.lone_starts.At(1)},
          {"database_bytes", DatabaseBytes(flags)}};
}

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
        "INSERT INTO bare_jobs (number, name, tenant, request_id, state, ended, end_time, work_key, mesh_sha256, "
        "seams_sha256, uv_sha256, uv_bytes, record, report, create_time, work, due) SELECT number, name, tenant, "
        "md5(name), 1, 0, 0, CAST('key of ' || name AS BYTEA), CAST(name AS BYTEA), '', '', 0, ?, '', number, name, "
        "9223372036854775807 FROM bare_works ORDER BY number",
        {SqlBytes{record_}});
    sql.Run("INSERT INTO bare_labels SELECT number, 'asset', 'crate' FROM bare_works ORDER BY number");
    sql.Run("INSERT INTO bare_events SELECT number, 1, ?, 1 FROM bare_works ORDER BY number", {SqlBytes{record_}});
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
               "INSERT INTO bare_jobs (number, name, tenant, request_id, state, ended, end_time, work_key, "
               "mesh_sha256, seams_sha256, uv_sha256, uv_bytes, record, report, create_time, work, due) VALUES "
               "(nextval('bare_numbers'), ?, ?, ?, 1, 0, 0, ?, ?, '', '', 0, ?, '', ?, ?, "
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

nlohmann::json Bare(const Flags& flags) {
  const double rate = BareJobs(flags).JobsPerSecond();
  return {{"bench", "bare"}, {"jobs", flags.jobs}, {"jobs_per_second", rate}};
}

nlohmann::json Machines(const Flags& flags) {
  std::map<int, double> rate;
  for (const int machines : {1, flags.sleeping_machines}) {
    Round round;
    std::optional<Machinery> machinery(std::in_place, flags, machines, flags.worker_seconds, /*stagger=*/0, &round);
    // Whole sleeps, of which the first ends after the first.
    const auto at = Clock::now() +
                    std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(flags.sleeping_seconds));
    std::this_thread::sleep_until(at);
    rate[machines] = round.finished / flags.sleeping_seconds;
    round.over = true;
    machinery.reset();
  }
  return {{"bench", "machines"},
          {"worker_seconds", flags.worker_seconds},
          {"machines", flags.sleeping_machines},
          {"one", rate[1]},
          {"many", rate[flags.sleeping_machines]},
          {"ratio", rate[flags.sleeping_machines] / rate[1]}};
}

int Main(int argc, char** argv) {
  Flags flags;
  CLI::App app("How many jobs a second a PostgreSQL takes, beside bare SQL");
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  app.add_option("url", flags.url, "an empty database")->required();
  app.add_option("--machines", flags.machines)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--slots", flags.slots, "workers of each")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--waiting", flags.waiting, "jobs that wait")->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--jobs", flags.jobs, "that end in a round")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--rounds", flags.rounds)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--kinds", flags.kinds, "of what each round measures")
      ->delimiter(',')
      ->check(CLI::IsMember({"saturated", "steady", "light"}))
      ->capture_default_str();
  app.add_option("--load", flags.load, "of bare SQL's jobs a second, what the workers of \"steady\" can end")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--bare-accounts", flags.bare_accounts, "bare SQL writes the accounts of tenants, too")
      ->capture_default_str();
  app.add_option("--sleeping-machines", flags.sleeping_machines, "of \"machines\"; 0: leave it out")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const auto print = [](const nlohmann::json& result) {
    std::printf("%s\n", result.dump().c_str());
    std::fflush(stdout);
  };
  Fill(flags, flags.waiting);
  for (int i = 0; i < flags.rounds; ++i) {
    const nlohmann::json bare = Bare(flags);
    print(bare);
    const double offered = flags.load * bare["jobs_per_second"].get<double>();
    for (const std::string& kind : flags.kinds) {
      if (kind == "saturated") print(Store(flags, kind, 0, flags.jobs));
      if (kind == "steady") print(Store(flags, kind, flags.machines * flags.slots / offered, flags.jobs));
      if (kind == "light") print(Store(flags, kind, flags.machines * flags.slots / (offered / 2), flags.jobs / 2));
    }
  }
  if (flags.sleeping_machines > 0) print(Machines(flags));
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  try {
    return planish::bench::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "planish_store_load: %s\n", error.what());
    return 1;
  }
}
