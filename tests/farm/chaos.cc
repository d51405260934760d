// planish_farm_chaos: two fronts behind HAProxy, three workers, PostgreSQL with a synchronous standby. Eight callers
// who know only the proxy have CHAOS_JOBS (1,000) meshes flattened, while processes of all of them are killed or
// stopped. Fails unless every job ends once, and well unless its three attempts were killed, in order and without a gap
// for whoever watches, and nothing of it is left over. SEED chooses what dies when.
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <iostream>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "tests/farm/farm_fixture.h"

namespace planish {
namespace {

int FromEnvironment(const char* name, int otherwise) {
  const char* const text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

class FarmChaos : public FarmTest {
 protected:
  static constexpr int kCallers = 8;

  // A number that the database at `host` answers.
  std::int64_t Ask(const std::string& host, const std::string& sql) const {
    const std::string database = url_.substr(url_.rfind('/', url_.find('?')) + 1);
    const Outcome outcome = RunShell("/usr/lib/postgresql/15/bin/psql -h " + host + " -U planish -d " +
                                     database.substr(0, database.find('?')) + " -Atqc \"" + sql + "\"");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return std::atoll(outcome.out.c_str());
  }

  // One caller's jobs.
  void Call(int caller) {
    Client client = ClientOf("proxy");
    while (next_++ < jobs_) {
      // 800 to 24,000 triangles: some hundredths of a second to one.
      const Arrays mesh(20 + static_cast<int>(next_ % 90));
      Heard heard;
      CallOptions options;
      options.scheduling.fresh = true;
      try {
        const UnwrapResult result = client.Unwrap(mesh.View(), {}, heard.Listen(), options);
        if (result.uv.size() == 2 * mesh.triangles.size()) ++well_;
        if (!heard.in_order()) ++out_of_order_;
        if (heard.ends() != 1) ++ended_twice_;
        if (heard.skipped() > 0) ++skipped_;
      } catch (const Error& error) {
        // Its third attempt died as the two before.
        if (error.reason() == "SERVER_CRASHED" || error.reason() == "WORKER_CRASHED") {
          ++hit_thrice_;
          continue;
        }
        const std::lock_guard lock(mutex_);
        std::cout << "caller " << caller << ": " << error.what() << "\n";
        ++failed_;
      }
    }
    ++done_;
  }

  const int jobs_ = FromEnvironment("CHAOS_JOBS", 1000);
  std::mt19937 random_{static_cast<unsigned>(FromEnvironment("SEED", 1))};
  std::atomic<int> next_ = 0, well_ = 0, failed_ = 0, out_of_order_ = 0, ended_twice_ = 0, skipped_ = 0,
                   hit_thrice_ = 0, done_ = 0;
  std::mutex mutex_;
};

TEST_F(FarmChaos, EveryJobEndsOnce) {
  PostgresServer standby(*postgres_);
  postgres_->SetSynchronous();
  url_ = url_.substr(0, url_.find('?')) + "?host=" + postgres_->host() + "," + standby.host() +
         "&target_session_attrs=read-write";
  const std::vector<std::string> fronts = {"front0", "front1"}, workers = {"worker0", "worker1", "worker2"};
  for (const std::string& front : fronts) StartFront(front);
  for (const std::string& worker : workers) StartWorker(worker, 2);
  ASSERT_TRUE(StartProxy(fronts));

  const double begin = Now();
  std::vector<std::thread> callers;
  for (int i = 0; i < kCallers; ++i) callers.emplace_back([this, i] { Call(i); });
  std::map<std::string, int> deaths;
  const PostgresServer* primary = postgres_.get();
  const auto pick = [&](const std::vector<std::string>& names) { return names[random_() % names.size()]; };
  while (done_ < kCallers) {
    usleep(300'000 + random_() % 700'000);
    const unsigned what = random_() % 10;
    if (primary == postgres_.get() && well_ > 0.7 * jobs_) {
      postgres_->Crash();
      standby.Promote();
      primary = &standby;
      ++deaths["promotion of the standby"];
    } else if (what < 2) {
      const std::string front = pick(fronts);
      daemons_[front]->Signal(SIGKILL);
      daemons_[front]->Wait();
      StartFront(front);
      ++deaths["front"];
    } else if (what < 4) {
      const std::string worker = pick(workers);
      daemons_[worker]->Signal(SIGKILL);
      daemons_[worker]->Wait();
      StartWorker(worker, 2);
      ++deaths["worker"];
    } else if (what < 6) {
      const std::string worker = pick(workers);
      daemons_[worker]->Signal(SIGSTOP);
      sleep(4);  // longer than its lease
      daemons_[worker]->Signal(SIGCONT);
      ++deaths["worker stopped and continued"];
    } else if (what < 9) {
      const std::vector<pid_t> processes = ChildrenOf(daemons_[pick(workers)]->pid());
      if (!processes.empty()) kill(processes[random_() % processes.size()], SIGKILL);
      ++deaths["process of a worker"];
    } else if (primary == postgres_.get()) {
      postgres_->Crash();
      usleep(200'000);
      postgres_->Start();
      ++deaths["PostgreSQL"];
    }
  }
  for (std::thread& caller : callers) caller.join();
  std::cout << well_ << " of " << jobs_ << " jobs in " << Now() - begin << " s;";
  for (const auto& [what, count] : deaths) std::cout << " " << what << ": " << count << ";";
  std::cout << " " << hit_thrice_ << " jobs failed since all their three attempts were killed\n";
  EXPECT_EQ(well_ + hit_thrice_, jobs_);
  EXPECT_LT(hit_thrice_, 10);
  EXPECT_EQ(failed_, 0);
  EXPECT_EQ(out_of_order_, 0);
  EXPECT_EQ(ended_twice_, 0);
  EXPECT_EQ(skipped_, 0);

  // What is left in the database.
  const std::string host = primary->host();
  EXPECT_TRUE(WaitUntil([&] { return Ask(host, "SELECT count(*) FROM works") == 0; }));
  EXPECT_EQ(Ask(host, "SELECT count(*) FROM jobs WHERE ended = 0"), 0);
  EXPECT_EQ(Ask(host, "SELECT coalesce(sum(waiting), 0) + coalesce(sum(running), 0) FROM tenants"), 0);
  EXPECT_EQ(Ask(host, "SELECT count(*) FROM events WHERE job NOT IN (SELECT number FROM jobs)"), 0);
  EXPECT_EQ(Ask(host, "SELECT sum(ended) FROM tenants"), Ask(host, "SELECT count(*) FROM jobs"));
  // Bytes in rows that no job needs. Those that a server left that died are found by the next one that starts; larger
  // ones, in pieces, when they are half an hour old.
  StartFront("last");
  EXPECT_TRUE(WaitUntil([&] {
    return Ask(host,
               "SELECT count(*) FROM blobs b WHERE NOT EXISTS (SELECT 1 FROM jobs j WHERE j.tenant = b.tenant AND "
               "(j.ended = 0 AND (j.mesh_sha256 = b.sha256 OR j.elements_sha256 = b.sha256) OR j.outcome = 4 AND "
               "j.uv_sha256 = b.sha256))") == 0;
  }));
}

}  // namespace
}  // namespace planish
