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
//   "bare"       rows of the same size by four transactions a job: INSERT, UPDATE, UPDATE, an event with each, and
//                DELETE; statements travel together as those of the store do
//   "machines"   jobs a second of one machine and of many whose workers sleep
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
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
  Latencies claims, finishes, lone_starts;
  std::mutex mutex;
  std::map<std::string, Clock::time_point> lone;  // jobs of the tenant that has no others
};

// Seconds between two of what each machine asks of the store, as JobRunner and JobManager have them.
struct Intervals {
  explicit Intervals(int machines) : claims(machines / 250.0 > 0.02 ? machines / 250.0 : 0), looks(machines / 20.0) {}

  double claims;
  double renewals = 3;  // a fifth of a lease of 15 s; of leases that are older than half of that
  double looks;         // for jobs that are overdue, and for servers that are gone
};

// What a machine does until the round is over: one thread claims what its free workers may take, the other one ends it
// after `sleep` seconds, renews leases, and looks for the jobs of others.
class Machine {
 public:
  Machine(JobStore* store, std::string owner, int slots, double sleep, Intervals intervals, Round* round)
      : store_(*store), owner_(std::move(owner)), slots_(slots), sleep_(sleep), intervals_(intervals), round_(*round) {}

  void Claim() {
    std::minstd_rand random(static_cast<unsigned>(std::hash<std::string>()(owner_)));
    std::uniform_real_distribution<double> jitter(0.5, 1.5);
    while (!round_.over) {
      ClaimRequest request;
      request.owner = owner_;
      request.lease = absl::Seconds(15);
      {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, kLook, [&] { return static_cast<int>(running_.size()) < slots_; });
        request.most = slots_ - static_cast<int>(running_.size());
      }
      if (request.most == 0) continue;
      const Clock::time_point start = Clock::now();
      const std::vector<ClaimedWork> claimed = Get(store_.Claim(Now(), request));
      round_.claims.Add(Since(start));
      {
        const std::lock_guard lock(mutex_);
        for (const ClaimedWork& work : claimed) {
          running_.emplace(After(sleep_ * jitter(random)), Held{work.lease, Clock::now()});
        }
      }
      changed_.notify_all();
      for (const ClaimedWork& work : claimed) NoteLone(work.jobs[0].record.job());
      std::this_thread::sleep_for(std::chrono::duration<double>(std::max(Pause(), claimed.empty() ? 0.02 : 0)));
    }
  }

  void Finish() {
    Clock::time_point renewed = Clock::now(), asked = renewed, looked = renewed;
    while (!round_.over) {
      std::optional<Lease> due;
      std::vector<Lease> leases;  // to be renewed
      {
        std::unique_lock lock(mutex_);
        const Clock::time_point next = running_.empty() ? After(1) : running_.begin()->first;
        changed_.wait_until(lock, std::min(next, Clock::now() + kLook),
                            [&] { return !running_.empty() && running_.begin()->first <= Clock::now(); });
        if (!running_.empty() && running_.begin()->first <= Clock::now()) due = running_.begin()->second.lease;
        if (Since(renewed) > intervals_.renewals) {
          renewed = Clock::now();
          for (auto& [end, held] : running_) {
            if (Since(held.renewed) < intervals_.renewals / 2) continue;
            held.renewed = renewed;
            leases.push_back(held.lease);
          }
        }
      }
      if (due.has_value()) {
        const Clock::time_point start = Clock::now();
        Get(store_.Finish(Now(), *due, Success()));
        round_.finishes.Add(Since(start));
        ++round_.finished;
        const std::lock_guard lock(mutex_);
        running_.erase(std::find_if(running_.begin(), running_.end(),
                                    [&](const auto& entry) { return entry.second.lease.work == due->work; }));
        changed_.notify_all();
      }
      if (Since(asked) > 1 && !store_.hears_others()) {
        Get(store_.Wishes(owner_));
        asked = Clock::now();
      }
      if (!leases.empty()) Get(store_.Renew(leases, absl::Seconds(15)));
      if (Since(looked) > intervals_.looks) {
        Get(store_.EndOverdue(Now(), 100));
        Get(store_.Reap(Now(), "", 100));
        looked = Clock::now();
      }
    }
  }

  void Leave() { Get(store_.Release(Now(), owner_)); }

 private:
  static constexpr std::chrono::seconds kLook{1};  // whether the round is over

  static Clock::time_point After(double seconds) {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  // To this machine's place in the next interval between claims.
  double Pause() const {
    if (intervals_.claims == 0) return 0;
    const double place = double(std::hash<std::string>()(owner_) % 1000) / 1000;
    const double now = std::chrono::duration<double>(Clock::now().time_since_epoch()).count() / intervals_.claims;
    return (1 - std::fmod(now + place, 1)) * intervals_.claims;
  }

  void NoteLone(const v1::Job& job) {
    if (job.tenant() != "lone") return;
    const std::lock_guard lock(round_.mutex);
    const auto found = round_.lone.find(job.name());
    if (found != round_.lone.end()) round_.lone_starts.Add(Since(found->second));  // not one of an earlier round
  }

  JobStore& store_;
  const std::string owner_;
  const int slots_;
  const double sleep_;
  const Intervals intervals_;
  Round& round_;

  std::mutex mutex_;
  std::condition_variable changed_;
  struct Held {
    Lease lease;
    Clock::time_point renewed;
  };
  std::multimap<Clock::time_point, Held> running_;  // by when each ends; guarded by mutex_
};

// Machines and the threads of each. Ends with the round.
class Machinery {
 public:
  // Workers take `sleep` seconds a job, more or less. The machines begin one after the other within `stagger` seconds.
  Machinery(const Flags& flags, int machines, double sleep, double stagger, Round* round);
  ~Machinery() {
    crowd_.Join();
    for (const std::unique_ptr<Machine>& machine : machines_) machine->Leave();
  }

 private:
  std::vector<std::unique_ptr<JobStore>> stores_;
  std::vector<std::unique_ptr<Machine>> machines_;
  Crowd crowd_;
};

Machinery::Machinery(const Flags& flags, int machines, double sleep, double stagger, Round* round) {
  for (int i = 0; i < machines; ++i) {
    stores_.push_back(OpenStore(flags, machines, 2, /*must_hear=*/false));
    machines_.push_back(std::make_unique<Machine>(stores_.back().get(), absl::StrCat("machine", i), flags.slots, sleep,
                                                  Intervals(machines), round));
  }
  for (int i = 0; i < machines; ++i) {
    Machine* const machine = machines_[std::size_t(i)].get();
    crowd_.Add([machine, stagger, i, machines] {
      std::this_thread::sleep_for(std::chrono::duration<double>(stagger * i / machines));
      machine->Claim();
    });
    crowd_.Add([machine] { machine->Finish(); });
  }
}

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
  const int warm = round.finished + 20 * flags.machines;
  while (round.finished < warm) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  for (Latencies* const each : {&round.claims, &round.finishes, &round.lone_starts}) each->Clear();
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
          {"finish_p99_seconds", round.finishes.At(0.99)},
          {"lone_start_max_seconds", round.lone_starts.At(1)},
          {"database_bytes", DatabaseBytes(flags)}};
}

// The rows of a job as the store has them, in tables of the same definition, by as many transactions and no more
// statements than it takes: what is left is what the store knows of order, shares and limits.
nlohmann::json Bare(const Flags& flags) {
  const NewJob example = MakeJob("tenant0");
  const std::string record = example.record.SerializeAsString();
  const std::string report = Success().report.SerializeAsString();
  Connection setup(flags.url);
  setup.Run("SET client_min_messages = warning");
  setup.Run("DROP TABLE IF EXISTS bare_jobs, bare_works, bare_events, bare_labels");
  setup.Run("DROP SEQUENCE IF EXISTS bare_numbers");
  setup.Run("CREATE SEQUENCE bare_numbers");
  for (const std::string table : {"jobs", "works", "events", "labels"}) {
    setup.Run(absl::StrCat("CREATE TABLE bare_", table, " (LIKE ", table, " INCLUDING ALL)"));
  }
  const std::string jobs =
      "INSERT INTO bare_jobs (number, name, tenant, request_id, state, ended, end_time, work_key, mesh_sha256, "
      "seams_sha256, uv_sha256, uv_bytes, record, create_time, work, due) ";
  const std::string works =
      "INSERT INTO bare_works (name, tenant, number, running, turn_time, memory_bytes, mesh_bytes, run_time, alone, "
      "wish, owner, attempt, lease_until, start_time, charge, share) ";
  setup.Run(jobs +
                "SELECT nextval('bare_numbers'), 'jobs/' || i, 'tenant0', CAST(i AS TEXT), 1, 0, 0, "
                "decode(md5(CAST(i AS TEXT)), 'hex'), decode(md5(CAST(i AS TEXT)), 'hex'), '', '', 0, ?, i, 'jobs/' || "
                "i, 9223372036854775807 FROM generate_series(1, ?) AS i",
            {SqlBytes{record}, flags.waiting});
  setup.Run(works +
                "SELECT 'jobs/' || i, 'tenant0', i, 0, i, 100000000, 100000, 3000000000, 0, 0, '', 0, 0, 0, 0, 1000000 "
                "FROM generate_series(1, ?) AS i",
            {flags.waiting});
  for (const std::string table : {"jobs", "works"}) setup.Run("ANALYZE bare_" + table);
  std::atomic<int> left = flags.jobs;
  const Clock::time_point start = Clock::now();
  Crowd crowd;
  for (int i = 0; i < flags.fronts; ++i) {
    crowd.Add([&] {
      Connection sql(flags.url);
      const std::string event = "INSERT INTO bare_events (job, sequence, event, kind) VALUES (?, ?, ?, 1)";
      while (--left >= 0) {
        const std::string name = "jobs/" + RandomId(), request_id = RandomId();
        sql.Begin(Durability::kNow);
        const std::int64_t number =
            sql.Run(jobs +
                        "VALUES (nextval('bare_numbers'), ?, 'tenant0', ?, 1, 0, 0, ?, ?, '', '', 0, ?, 1, ?, "
                        "9223372036854775807) RETURNING number",
                    {std::string_view(name), std::string_view(request_id), SqlBytes{name}, SqlBytes{name},
                     SqlBytes{record}, std::string_view(name)})
                .Int(0, 0);
        sql.Send("INSERT INTO bare_labels VALUES (?, 'asset', 'crate')", {number});
        sql.Send(works + "VALUES (?, 'tenant0', ?, 0, 1, 100000000, 100000, 3000000000, 0, 0, '', 0, 0, 0, 0, 1000000)",
                 {std::string_view(name), number});
        sql.Send(event, {number, 1, SqlBytes{record}});
        sql.Commit();
        sql.Begin(Durability::kLater);
        sql.Send("UPDATE bare_jobs SET state = 2, record = ? WHERE number = ?", {SqlBytes{record}, number});
        sql.Send(
            "UPDATE bare_works SET running = 1, owner = 'a', attempt = 1, lease_until = 9, start_time = 1, charge = 1 "
            "WHERE name = ?",
            {std::string_view(name)});
        sql.Send(event, {number, 2, SqlBytes{record}});
        sql.Commit();
        sql.Begin(Durability::kNow);
        sql.Send(
            "UPDATE bare_jobs SET state = 4, record = ?, ended = 1, end_time = 5, uv_sha256 = ?, uv_bytes = 9, report "
            "= "
            "? WHERE number = ?",
            {SqlBytes{record}, SqlBytes{name}, SqlBytes{report}, number});
        sql.Send("DELETE FROM bare_works WHERE name = ?", {std::string_view(name)});
        sql.Send(event, {number, 3, SqlBytes{record}});
        sql.Commit();
        sql.Begin(Durability::kLater);
        sql.Send("DELETE FROM bare_events WHERE job = ?", {number});
        sql.Send("DELETE FROM bare_labels WHERE job = ?", {number});
        sql.Send("DELETE FROM bare_jobs WHERE number = ?", {number});
        sql.Commit();
      }
    });
  }
  crowd.Join();
  const double seconds = Since(start);
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
