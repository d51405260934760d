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
#include <semaphore>
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
#include "tests/bench/bare_jobs.h"
#include "tests/bench/farm_load.h"

namespace planish::bench {
namespace {

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
  std::size_t size() {
    const std::lock_guard lock(mutex_);
    return seconds_.size();
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

std::int64_t DatabaseBytes(const Flags& flags) {
  return Connection(flags.url).Run("SELECT pg_database_size(current_database())").Int(0, 0);
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
  std::atomic<int> finished = 0;
  std::atomic<int> given_up = 0;           // claims that did not have their turn in time
  std::counting_semaphore<> to_accept{0};  // as many as have finished, by the fronts
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
      : store_holder_(OpenStore(flags, machines, 3, /*must_hear=*/false)),
        store_(*store_holder_),
        owner_(std::move(owner)),
        machines_(machines),
        sleep_(sleep),
        round_(*round),
        free_(static_cast<std::size_t>(flags.slots), Clock::now()) {}

  void Claim() {
    ClaimPace pace(owner_);
    const absl::Duration interval = SharedPace(machines_, kClaimsPerSecond, kLeastClaimInterval);
    std::minstd_rand random(static_cast<unsigned>(std::hash<std::string>()(owner_)));
    std::uniform_real_distribution<double> jitter(0.5, 1.5);
    while (!round_.over) {
      ClaimRequest request;
      request.owner = owner_;
      request.lease = absl::Seconds(kLease);
      {
        std::unique_lock lock(mutex_);
        freed_.wait_for(lock, kLook, [&] { return !free_.empty(); });
        request.most = static_cast<int>(free_.size());
      }
      if (request.most == 0) continue;
      const Clock::time_point start = Clock::now();
      ClaimWait wait;
      const std::vector<ClaimedWork> claimed = Get(store_.Claim(Now(), request, &wait));
      round_.claims.Add(Since(start));
      if (wait.gave_up) ++round_.given_up;
      {
        const std::lock_guard lock(mutex_);
        for (const ClaimedWork& work : claimed) {
          round_.waits.Add(Since(free_.front()));
          free_.pop_front();
          ends_.emplace(After(sleep_ * jitter(random)), work.lease);
          running_[work.lease.work] = {work.lease, Clock::now()};
        }
      }
      given_.notify_one();
      sooner_.notify_one();
      for (const ClaimedWork& work : claimed) NoteLone(work.jobs[0].record.job());
      const absl::Time now = absl::Now();
      const absl::Time next = pace.Next(now, interval, wait.queued);
      Pause(std::max(absl::ToDoubleSeconds(next - now), claimed.empty() ? 0.02 : 0));
    }
  }

  // What one worker ends. One of those that are free waits for the next end; the others sleep.
  void Finish() {
    while (const std::optional<Lease> lease = NextEnd()) {
      const Clock::time_point start = Clock::now();
      Get(store_.Finish(Now(), *lease, Success()));
      round_.finishes.Add(Since(start));
      ++round_.finished;
      round_.to_accept.release();
      const std::lock_guard lock(mutex_);
      running_.erase(lease->work);
      free_.push_back(Clock::now());
      freed_.notify_one();
    }
  }

  // `place`, 0 to 1: of this machine among all, which began at different moments.
  void KeepOrder(double place) {
    if (!Pause(kRenewal * place)) return;
    Clock::time_point renewed = Clock::now(), asked = renewed, looked = renewed;
    for (; Pause(0.5);) {
      std::vector<Lease> leases;
      if (Since(renewed) > kRenewal) {
        const std::lock_guard lock(mutex_);
        renewed = Clock::now();
        for (auto& [work, held] : running_) {
          if (Since(held.renewed) < kRenewal / 2) continue;
          held.renewed = renewed;
          leases.push_back(held.lease);
        }
      }
      if (!leases.empty()) Get(store_.Renew(leases, absl::Seconds(kLease)));
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

  // After the round is over: threads that wait end.
  void Wake() {
    const std::lock_guard lock(mutex_);
    given_.notify_all();
    sooner_.notify_all();
  }

  void Leave() { Get(store_.Release(Now(), owner_)); }

 private:
  static constexpr std::chrono::seconds kLook{1};                              // whether the round is over
  static constexpr double kLease = 15, kRenewal = kLease / kRenewalsPerLease;  // seconds

  static Clock::time_point After(double seconds) {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  // When it is time to; nothing if the round is over.
  std::optional<Lease> NextEnd() {
    std::unique_lock lock(mutex_);
    given_.wait(lock, [&] { return round_.over || (!awaited_ && !ends_.empty()); });
    awaited_ = true;
    while (!round_.over && ends_.begin()->first > Clock::now()) {
      const Clock::time_point end = ends_.begin()->first;
      sooner_.wait_until(lock, end, [&] { return round_.over || ends_.begin()->first < end; });
    }
    if (round_.over) return std::nullopt;
    const Lease lease = std::move(ends_.begin()->second);
    ends_.erase(ends_.begin());
    awaited_ = false;
    if (!ends_.empty()) given_.notify_one();
    return lease;
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
  std::condition_variable freed_;   // a worker is
  std::condition_variable given_;   // work is there whose end nobody waits for
  std::condition_variable sooner_;  // work is there that ends before what is waited for
  struct Held {
    Lease lease;
    Clock::time_point renewed;
  };
  // Guarded by mutex_.
  std::deque<Clock::time_point> free_;            // workers, since when each
  std::multimap<Clock::time_point, Lease> ends_;  // of what runs, but for what is being finished
  std::map<std::string, Held> running_;           // by work
  bool awaited_ = false;                          // a thread waits for the first end
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
      crowd_.Add([machine, i, machines] { machine->KeepOrder(double(i) / machines); });
      for (int slot = 0; slot < flags.slots; ++slot) crowd_.Add([machine] { machine->Finish(); });
    }
  }
  // The round is over.
  ~Machinery() {
    for (const std::unique_ptr<Machine>& machine : machines_) machine->Wake();
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
  std::atomic<int> accepted = 0;
  Crowd crowd;
  for (int i = 0; i < flags.fronts; ++i) {
    crowd.Add([&] {
      for (round.to_accept.acquire(); !round.over; round.to_accept.acquire()) {
        Get(front->Accept(Now(), MakeJob(Tenant(accepted++ % flags.tenants))));
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
  round.given_up = 0;
  const int before = round.finished;
  const Clock::time_point start = Clock::now();
  while (round.finished < before + jobs) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const double seconds = Since(start);
  const int finished = round.finished - before;
  round.over = true;
  round.to_accept.release(flags.fronts);
  crowd.Join();
  machinery.reset();
  return {{"bench", name},
          {"worker_seconds", sleep},
          {"machines", flags.machines},
          {"slots", flags.slots},
          {"waiting", flags.waiting},
          {"jobs", finished},
          {"jobs_per_second", finished / seconds},
          {"claims", round.claims.size()},
          {"claims_given_up", round.given_up.load()},
          {"claim_p50_seconds", round.claims.At(0.5)},
          {"claim_p99_seconds", round.claims.At(0.99)},
          {"wait_p50_seconds", round.waits.At(0.5)},
          {"finish_p99_seconds", round.finishes.At(0.99)},
          {"lone_start_max_seconds", round.lone_starts.At(1)},
          {"database_bytes", DatabaseBytes(flags)}};
}

nlohmann::json Bare(const Flags& flags) {
  const double rate = flags.bare_rate > 0 ? flags.bare_rate : BareJobs(flags).JobsPerSecond();
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
  app.add_option("--bare-rate", flags.bare_rate, "jobs a second, in place of a measurement; 0: measure")
      ->check(CLI::NonNegativeNumber)
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
