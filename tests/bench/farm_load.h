// What planish_store_load and its bare SQL have in common: how much there is of everything, one job, and connections.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/store/ids.h"
#include "server/store/job_store.h"
#include "server/store/lifecycle.h"

namespace planish::bench {

using Clock = std::chrono::steady_clock;

inline double Since(Clock::time_point start) {
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
  double bare_rate = 0;  // what bare SQL does, where that is known
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
inline std::unique_ptr<JobStore> OpenStore(const Flags& flags, int machines, int connections, bool must_hear) {
  PostgresOptions options;
  options.url = flags.url;
  options.connections = connections;
  options.must_hear = must_hear;
  std::unique_ptr<SqlDatabase> opened = Get(OpenPostgresDatabase(options));
  SqlDatabase* const database = opened.get();
  std::unique_ptr<JobStore> store = std::make_unique<JobStore>(std::move(opened));
  database->SetProcesses(machines + 1, 1);
  Get(store->Find(""));  // makes the first connection: not all machines at once
  return store;
}

inline VerbContext Now() {
  return {};
}

// About what a real record has.
inline NewJob MakeJob(const std::string& tenant) {
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

inline AttemptOutcome Success() {
  AttemptOutcome outcome;
  v1::Report* const report = &outcome.report;
  report->mutable_input()->set_triangles(20'000);
  for (int i = 0; i < 20; ++i) report->add_charts()->set_stop_message("converged after 3 Newton steps, and so on");
  outcome.uv.set_uv_sha256(std::string(32, 'u'));
  outcome.uv.set_total_bytes(480'000);
  return outcome;
}

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

inline std::string Tenant(int number) {
  return absl::StrCat("tenant", number);
}

}  // namespace planish::bench
