// A JobStore of each engine, and what its tests have in common.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "core/base/error.h"
#include "gtest/gtest.h"
#include "server/link/rpc_status.h"
#include "server/store/job_store.h"
#include "server/store/lifecycle.h"
#include "tests/server/store/failing_database.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/files.h"

namespace planish {

enum class Engine { kSqliteInMemory, kSqlite, kPostgres };

inline std::string ErrorReason(const absl::Status& status) {
  return ErrorInfoOf(status).reason;
}

class JobStoreTest : public ::testing::TestWithParam<Engine> {
 protected:
  static void TearDownTestSuite() { running_.reset(); }

  JobStoreTest() {
    if (GetParam() == Engine::kPostgres) {
      if (running_ == nullptr) running_ = std::make_unique<PostgresServer>();
      url_ = running_->NewDatabase();
    }
    store_ = Open();
  }

  std::unique_ptr<SqlDatabase> OpenDatabase() {
    absl::StatusOr<std::unique_ptr<SqlDatabase>> database =
        GetParam() == Engine::kPostgres ? OpenPostgresDatabase({url_, 6})
        : GetParam() == Engine::kSqlite ? OpenSqliteDatabase(directory_.Path("jobs.sqlite"))
                                        : OpenSqliteDatabase(":memory:");
    EXPECT_TRUE(database.ok()) << database.status();
    return *std::move(database);
  }

  std::unique_ptr<JobStore> Open() {
    JobStoreOptions options;
    options.clock = [this] { return now_; };
    return std::make_unique<JobStore>(std::make_unique<FailingDatabase>(OpenDatabase(), &fault_), options);
  }

  // Another process's view of the same data; the same object where there can be only one.
  JobStore& Other() {
    if (GetParam() != Engine::kPostgres) return *store_;
    if (other_ == nullptr) other_ = Open();
    return *other_;
  }

  static NewJob Job(const std::string& name, const std::string& key = "") {
    NewJob job;
    v1::Job* const described = job.record.mutable_job();
    described->set_name("jobs/" + name);
    described->set_state(v1::JOB_STATE_QUEUED);
    described->set_tenant("ann");
    described->set_memory_bytes(100);
    job.record.set_work_key(key.empty() ? "key of " + name : key);
    job.record.set_mesh_sha256("mesh of " + job.record.work_key());
    described->mutable_create_time()->set_seconds(1000);
    return job;
  }

  static NewJob JobOf(const std::string& tenant, const std::string& name) {
    NewJob job = Job(name);
    job.record.mutable_job()->set_tenant(tenant);
    job.run_time = absl::Seconds(10);
    return job;
  }

  AcceptedChange Accept(const NewJob& job) {
    absl::StatusOr<AcceptedChange> accepted = store_->Accept(context_, job);
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted.ok() ? *std::move(accepted) : AcceptedChange();
  }
  std::string Add(const std::string& name, const std::string& key = "") {
    return Accept(Job(name, key)).change.record.job().name();
  }

  // The lease of whatever is next; a work "" if there is nothing.
  Lease Claim(const std::string& owner = "a", const std::string& work = "") {
    ClaimRequest request = {owner, absl::Seconds(10), 1, 0, work, nullptr};
    absl::StatusOr<std::vector<ClaimedWork>> claimed = store_->Claim(context_, request);
    EXPECT_TRUE(claimed.ok()) << claimed.status();
    return claimed.ok() && !claimed->empty() ? claimed->front().lease : Lease();
  }

  static AttemptOutcome Success() {
    AttemptOutcome outcome;
    outcome.report.mutable_input()->set_triangles(7);
    outcome.uv.set_uv_sha256("uv");
    outcome.uv.set_total_bytes(5);
    return outcome;
  }
  static AttemptOutcome Lost(bool is_final = false) {
    AttemptOutcome outcome;
    outcome.loss = {"WORKER_CRASHED", "the worker was killed", {{"signal", "SIGSEGV"}}, is_final};
    return outcome;
  }

  JobRecord Find(const std::string& name) {
    const absl::StatusOr<std::optional<JobRecord>> record = store_->Find(name);
    EXPECT_TRUE(record.ok() && record->has_value()) << record.status();
    return record.ok() && record->has_value() ? **record : JobRecord();
  }
  v1::JobState State(const std::string& name) { return Find(name).job().state(); }
  std::string ErrorOf(const std::string& name) { return ReasonOf(Find(name).job().error()); }

  // "1 QUEUED, 2 RUNNING, 3 progress"
  std::string History(const std::string& name) {
    std::string text;
    const std::vector<v1::JobEvent> events = *store_->Events(Find(name).number());
    for (const v1::JobEvent& event : events) {
      if (!text.empty()) text += ", ";
      text += std::to_string(event.sequence()) + " " +
              (event.has_job() ? StateName(event.job().state()) : std::string("progress"));
    }
    return text;
  }

  const TempDir directory_;
  std::string url_;
  Fault fault_;
  VerbContext context_;
  absl::Time now_ = absl::FromUnixSeconds(5'000'000);
  std::unique_ptr<JobStore> store_, other_;
  static inline std::unique_ptr<PostgresServer> running_;  // for all cases: it takes a second to start
};

}  // namespace planish
