// A JobManager whose workers, clock and stores belong to the test.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/jobs/job_manager.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {

// A worker's end that only notes what it is sent.
class NotingLink : public WorkerLink {
 public:
  using WorkerLink::Send;
  void Send(worker::v1::ToWorker message, std::vector<BlobPtr>) override { sent.push_back(std::move(message)); }
  Wait Receive(absl::Time, Received*) override { return Wait::kClosed; }
  void Close() override { closed = true; }
  WorkerLoss HowEnded() override { return {}; }

  std::vector<worker::v1::ToWorker> sent;
  bool closed = false;
};

inline std::string Reason(const absl::Status& status) {
  return ErrorInfoOf(status).reason;
}

inline worker::v1::WorkResult Success(const std::string& uv) {
  worker::v1::WorkResult result;
  result.mutable_report()->mutable_input()->set_triangles(1);
  result.mutable_uv()->set_total_bytes(static_cast<std::int64_t>(uv.size()));
  result.mutable_uv()->set_uv_sha256(Sha256(uv));
  return result;
}

inline worker::v1::WorkResult Failure(const absl::Status& status) {
  worker::v1::WorkResult result;
  *result.mutable_status() = ToRpcStatus(status);
  return result;
}

inline worker::v1::WorkResult Cancelled() {
  return Failure(absl::CancelledError("cancelled"));
}

inline v1::Progress Iteration(int number) {
  v1::Progress progress;
  progress.set_newton_iteration(number);
  return progress;
}

// The test plays the workers: no threads. Meshes differ from each other unless a test says what they are.
class JobManagerTest : public ::testing::Test {
 protected:
  JobManagerTest() {
    options_.steady_clock = [this] { return now_ - absl::Hours(100'000); };  // never to be mixed with the other one
    options_.new_id = [this] { return "id" + std::to_string(++ids_); };
    options_.on_transition = [this](const v1::Job& job) {
      const std::lock_guard lock(transitions_mutex_);
      transitions_.push_back(StateName(job.state()));
    };
    options_.limits.queue_capacity = 2;
    options_.retry_delay = absl::Seconds(3);
    options_.report_interval = absl::ZeroDuration();
    options_.forecast_age = absl::ZeroDuration();
    options_.limits.reattach_grace = absl::ZeroDuration();
    Restart();
  }

  // A new server with nothing in its stores.
  void Restart() {
    manager_.reset();
    store_ = OpenStore(*OpenSqliteDatabase(":memory:"));
    blobs_ = std::make_unique<BlobCatalog>(BlobPlaces{}, store_bytes_);
    Resume();
  }

  // Its clock is that of the test.
  std::unique_ptr<JobStore> OpenStore(std::unique_ptr<SqlDatabase> database) {
    JobStoreOptions options;
    options.clock = [this] { return now_; };
    return std::make_unique<JobStore>(std::move(database), options);
  }

  // A new server on the stores of the last one, which died.
  void Crash() { manager_ = *JobManager::Open(options_, store_.get(), blobs_.get()); }

  // A new server on the stores of the last one, which ended in order.
  void Resume() {
    if (manager_ != nullptr) manager_->Suspend();
    manager_ = *JobManager::Open(options_, store_.get(), blobs_.get());
  }

  JobRequest Request(const std::string& request_id = "", bool attached = false) {
    JobRequest request;
    request.bytes = request_id.empty() ? "mesh" + std::to_string(++meshes_) : "mesh of " + request_id;
    request.request_id = request_id;
    request.attached = attached;
    return request;
  }

  std::string Create(const std::string& request_id = "") {
    const auto accepted = manager_->Create(caller_, Request(request_id));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted.ok() ? accepted->job.name() : "";
  }

  // Waits for work; nothing if there will be none.
  std::optional<JobAssignment> TakeNext() {
    JobAssignment assignment;
    const Turn turn = manager_->source()->TakeNext(absl::Hours(1), &assignment);
    return turn == Turn::kWork ? std::optional(std::move(assignment)) : std::nullopt;
  }

  // What a worker does, for the job that is next.
  std::string Take() {
    const std::optional<JobAssignment> assignment = TakeNext();
    attempt_ = assignment->attempt;
    return assignment->name;
  }
  void Report(const std::string& name, const worker::v1::WorkResult& result, const std::string& uv = "") {
    manager_->source()->ReportResult(name, attempt_, result, *Blob::Copy(uv));
  }
  void Succeed(const std::string& name, const std::string& uv = "uv") { Report(name, Success(uv), uv); }
  void Lose(const std::string& name) {
    manager_->source()->ReportLost(name, attempt_,
                                   {"WORKER_CRASHED", "the worker was killed", {{"signal", "SIGSEGV"}}});
  }

  // Creates a job and brings it to its end.
  std::string CreateEnded(const std::string& uv = "uv") {
    const std::string name = Create();
    EXPECT_EQ(Take(), name);
    Succeed(name, uv);
    return name;
  }

  v1::JobState State(const std::string& name) { return manager_->Get(caller_, name)->state(); }
  std::string ErrorReason(const std::string& name) {
    google::rpc::ErrorInfo info;
    const v1::Job job = *manager_->Get(caller_, name);
    return job.has_error() && job.error().details(0).UnpackTo(&info) ? info.reason() : "";
  }

  std::shared_ptr<const JobEventLog> Watch(const std::string& name) {
    return manager_->Watch(caller_, name, false, false)->events;
  }

  std::vector<v1::JobEvent> Events(const std::string& name) {
    const auto log = Watch(name);
    std::vector<v1::JobEvent> events;
    while (auto event = log->ReadAfter(events.empty() ? 0 : events.back().sequence()).event) events.push_back(*event);
    return events;
  }

  absl::StatusOr<JobPage> List(int page_size, const std::string& token = "", const std::string& filter = "") {
    v1::ListJobsRequest request;
    request.set_page_size(page_size);
    request.set_page_token(token);
    request.set_filter(filter);
    return manager_->List(caller_, request);
  }

  const Caller caller_ = {kDefaultTenant, "", Rights::All(), ""};
  absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  int ids_ = 0;
  int meshes_ = 0;
  int attempt_ = 0;
  std::int64_t store_bytes_ = 1 << 20;
  std::mutex transitions_mutex_;
  std::vector<std::string> transitions_;  // read them when no other thread changes jobs
  JobManagerOptions options_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<BlobCatalog> blobs_;
  std::unique_ptr<JobManager> manager_;
};

}  // namespace planish
