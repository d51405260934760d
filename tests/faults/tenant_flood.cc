#include "tests/faults/tenant_flood.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "absl/time/clock.h"
#include "core/draco/codec.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/worker_pool.h"
#include "server/link/process_link.h"
#include "server/store/lifecycle.h"
#include "server/worker/needs.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

const Caller kFlood = {"flood", "", Rights::All(), ""};
const Caller kSingle = {"single", "", Rights::All(), ""};

double SecondsBetween(const google::protobuf::Timestamp& from, const google::protobuf::Timestamp& to) {
  return static_cast<double>(TimeUtil::DurationToMicroseconds(to - from)) * 1e-6;
}

// What every job went through.
class Book {
 public:
  void Note(const v1::Job& job) {
    const std::lock_guard lock(mutex_);
    jobs_[job.name()] = job;
  }

  std::vector<v1::Job> Jobs(const std::string& tenant) const {
    const std::lock_guard lock(mutex_);
    std::vector<v1::Job> jobs;
    for (const auto& [name, job] : jobs_) {
      if (job.tenant() == tenant) jobs.push_back(job);
    }
    return jobs;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, v1::Job> jobs_;
};

class Flood {
 public:
  explicit Flood(const TenantFloodOptions& options)
      : options_(options), mesh_(*EncodeDraco(Bump(options.grid))), store_(*OpenJobStore(":memory:")) {
    JobManagerOptions manager;
    manager.workers = options.workers;
    manager.limits.queue_capacity = manager.queue_total = 2 * options.flood;
    manager.tenant_limits = [shares = options.shares](const std::string& tenant) {
      TenantLimits limits;
      if (const auto share = shares.find(tenant); share != shares.end()) limits.share = share->second;
      return limits;
    };
    manager.estimate = [](std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                          const v1::UnwrapOptions& unwrap) -> absl::StatusOr<JobNeeds> {
      const absl::StatusOr<WorkNeeds> needs = EstimateNeeds(draco, mesh_bytes, size, unwrap);
      if (!needs.ok()) return needs.status();
      return JobNeeds{needs->size, needs->memory_bytes, needs->run_seconds};
    };
    manager.on_transition = [this](const v1::Job& job) { book_.Note(job); };
    manager_ = *JobManager::Open(std::move(manager), store_.get(), &blobs_);
    WorkerPoolOptions pool;
    pool.workers = options.workers;
    pool_ = std::make_unique<WorkerPool>(
        manager_->source(), [] { return StartProcessWorker({}); }, std::move(pool));
  }

  ~Flood() {
    manager_->CancelAll();
    manager_->StopWorkers();
    manager_->CloseLinks();
    pool_.reset();
  }

  TenantFloodReport Run() {
    for (int i = 0; i < options_.flood; ++i) Create(kFlood);
    // Until workers are there, and what is known of the jobs is what they really take.
    while (Ended("flood").size() < static_cast<std::size_t>(2 * options_.workers)) Sleep();
    return options_.both > 0 ? BothFlood() : Singles();
  }

 private:
  static void Sleep() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

  std::string Create(const Caller& caller) {
    JobRequest request;
    request.bytes = mesh_;
    request.scheduling.set_fresh(true);
    const auto accepted = manager_->Create(caller, std::move(request));
    if (!accepted.ok()) throw std::runtime_error(accepted.status().ToString());
    return accepted->job.name();
  }

  std::vector<v1::Job> Ended(const std::string& tenant) const {
    std::vector<v1::Job> jobs = book_.Jobs(tenant);
    std::erase_if(jobs, [](const v1::Job& job) { return !IsTerminal(job.state()); });
    for (const v1::Job& job : jobs) {
      if (job.state() != v1::JOB_STATE_SUCCEEDED) throw std::runtime_error(job.ShortDebugString());
    }
    return jobs;
  }

  TenantFloodReport Singles() {
    TenantFloodReport report;
    std::vector<v1::Job> singles;
    for (int i = 0; i < options_.singles; ++i) {
      const std::string name = Create(kSingle);
      while (!IsTerminal(manager_->Get(kSingle, name)->state())) Sleep();
      singles.push_back(*manager_->Get(kSingle, name));
      report.single_wait_seconds.push_back(SecondsBetween(singles.back().create_time(), singles.back().start_time()));
      // The next one finds the flood on all workers, at any point of its jobs.
      const std::size_t ended = Ended("flood").size();
      while (Ended("flood").size() < ended + 3) Sleep();
    }
    if (Ended("flood").size() == static_cast<std::size_t>(options_.flood)) {
      throw std::runtime_error("the flood was over before the last single job");
    }
    for (const v1::Job& job : Ended("flood")) {
      report.flood_run_seconds.push_back(SecondsBetween(job.start_time(), job.end_time()));
    }
    for (const v1::Job& single : singles) {
      int before = 0;
      for (const v1::Job& job : book_.Jobs("flood")) {
        before +=
            job.has_start_time() && job.start_time() > single.create_time() && job.start_time() < single.start_time()
                ? 1
                : 0;
      }
      report.overtaken_by.push_back(before);
    }
    return report;
  }

  TenantFloodReport BothFlood() {
    v1::Job last;
    for (int i = 0; i < options_.flood; ++i) last = *manager_->Get(kSingle, Create(kSingle));
    // Both have jobs waiting from here on. What ended before says nothing about shares.
    const auto ended_since = [&](const std::string& tenant) {
      std::vector<v1::Job> jobs = Ended(tenant);
      std::erase_if(jobs, [&](const v1::Job& job) { return job.end_time() < last.create_time(); });
      return jobs;
    };
    const std::size_t wanted = static_cast<std::size_t>(options_.both);
    while (ended_since("flood").size() + ended_since("single").size() < wanted) Sleep();

    // The first of them, in the order in which they ended: the two lists are not of the same moment.
    std::vector<std::pair<v1::Job, bool>> jobs;
    for (v1::Job& job : ended_since("flood")) jobs.emplace_back(std::move(job), true);
    for (v1::Job& job : ended_since("single")) jobs.emplace_back(std::move(job), false);
    std::sort(jobs.begin(), jobs.end(),
              [](const auto& a, const auto& b) { return a.first.end_time() < b.first.end_time(); });
    jobs.resize(wanted);
    const google::protobuf::Timestamp end = jobs.back().first.end_time();
    for (const char* const tenant : {"flood", "single"}) {
      const std::vector<v1::Job> all = book_.Jobs(tenant);
      if (std::none_of(all.begin(), all.end(),
                       [&](const v1::Job& job) { return !job.has_start_time() || job.start_time() > end; })) {
        throw std::runtime_error(std::string(tenant) + " had no job waiting any more: more jobs are needed");
      }
    }
    TenantFloodReport report;
    for (const auto& [job, is_flood] : jobs) {
      ++(is_flood ? report.flood_ended : report.other_ended);
      (is_flood ? report.flood_worker_seconds : report.other_worker_seconds) +=
          SecondsBetween(job.start_time(), job.end_time());
    }
    return report;
  }

  const TenantFloodOptions options_;
  const std::string mesh_;
  Book book_;
  BlobCatalog blobs_{{}, std::int64_t{1} << 40};
  const std::unique_ptr<JobStore> store_;
  std::unique_ptr<JobManager> manager_;
  std::unique_ptr<WorkerPool> pool_;
};

}  // namespace

TenantFloodReport RunTenantFlood(const TenantFloodOptions& options) {
  return Flood(options).Run();
}

}  // namespace planish
