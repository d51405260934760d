// How requests become jobs.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planish/v1/planish.pb.h"
#include "server/access/caller.h"
#include "server/jobs/job_callers.h"
#include "server/jobs/job_feed.h"
#include "server/jobs/job_options.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/manager_stats.h"
#include "server/jobs/queue_forecast.h"

namespace planish {

struct AcceptedJob {
  v1::Job job;
  std::shared_ptr<const JobEventLog> events;
  JobAttachment attachment;  // empty unless JobRequest::attached
};

// Checks requests, and turns them into jobs in the store. Thread-safe. No lock is held while the store is asked.
class JobAdmission {
 public:
  // All arguments outlive the object. `seconds_factor`: the recent ratio of actual to estimated seconds of work.
  JobAdmission(JobContext* context, JobFeed* feed, JobCallers* callers, JobRetention* retention,
               std::function<double()> seconds_factor);

  // JobManager::Create. `refusal`: why no new jobs are accepted; OK if they are.
  absl::StatusOr<AcceptedJob> Create(const Caller& caller, JobRequest request, const absl::Status& refusal);
  // JobManager::CreateAll. `refusal` as above.
  std::vector<absl::StatusOr<AcceptedJob>> CreateAll(const Caller& caller, std::vector<JobRequest> requests,
                                                     const absl::Status& refusal);
  // JobManager::Estimate.
  absl::StatusOr<v1::JobEstimate> Estimate(const Caller& caller, const JobRequest& request, std::int64_t mesh_bytes,
                                           const v1::MeshSize& size) const;

  // The needs of a job with this mesh and these options. `array_vertices` as in JobRequest. `size`: the size of the
  // mesh, used if `mesh` does not tell it. Errors of the estimator, MESH_TOO_LARGE and MEMORY_LIMIT.
  absl::StatusOr<JobNeeds> NeedsOf(const std::string& tenant, std::string_view mesh,
                                   std::optional<std::int64_t> array_vertices, std::int64_t mesh_bytes,
                                   v1::MeshSize size, const v1::UnwrapOptions& options) const;
  // The limits on waiting work that apply to a tenant.
  QueueLimits LimitsOf(const std::string& tenant) const;
  // The place of a waiting job in the queue.
  absl::StatusOr<int> PositionOf(const JobRecord& record) const;
  // Adds the counts of calls since the start to TenantStats and to ManagerStats::refused_by_reason.
  void AddCalls(std::map<std::string, TenantStats>* tenants, std::map<std::string, std::int64_t>* refused) const;

 private:
  struct Calls {
    std::int64_t accepted = 0, refused = 0, shared = 0;
  };
  struct KeptResult {
    std::string name;
    StoredBlobPtr uv;
  };

  // A request that is about to be accepted.
  struct Prepared {
    std::optional<AcceptedJob> known;  // an existing job with this request id; then the rest is empty
    JobRequest request;
    std::string work_key;
    BlobHold mesh_hold, elements_hold;  // keep these blobs until the record refers to them
    std::vector<StoredBlobPtr> blobs;
    NewJob job;
    std::shared_ptr<JobEventLog> events;
    StoredBlobPtr uv;  // the UV of the job NewJob::result_of; null: none
  };
  absl::StatusOr<Prepared> Prepare(const Caller& caller, JobRequest asked, const absl::Status& refusal);
  absl::StatusOr<AcceptedJob> AnswerPrepared(const Caller& caller, Prepared* prepared,
                                             absl::StatusOr<AcceptedChange> accepted);
  // Counts `answer` if it is a refusal. Returns `answer`.
  absl::StatusOr<AcceptedJob> Noted(const Caller& caller, absl::StatusOr<AcceptedJob> answer);
  // The job that has the request's id, if there is one.
  absl::StatusOr<std::optional<AcceptedJob>> FindKnown(const Caller& caller, const JobRequest& request,
                                                       const std::string& work_key);
  absl::StatusOr<AcceptedJob> AnswerKnown(const Caller& caller, const JobRequest& request, const std::string& work_key,
                                          JobRecord record);
  absl::StatusOr<AcceptedJob> AnswerNew(const JobRequest& request, AcceptedChange accepted,
                                        std::shared_ptr<JobEventLog> events, const StoredBlobPtr& uv);
  // The newest kept result of work with this key, if there is any.
  std::optional<KeptResult> FindResult(const std::string& work_key) const;
  JobRecord NewRecord(const Caller& caller, const JobRequest& request) const;
  // Asks the forecast, after making a new one if it is too old.
  template <class Answer>
  absl::StatusOr<Answer> AskForecast(const std::function<Answer(QueueForecast*)>& question) const;
  absl::Status CheckRoom(const std::string& tenant, std::int64_t mesh_bytes) const;
  absl::Status QueueFull(const std::string& tenant, Room room) const;

  JobContext& context_;
  JobFeed& feed_;
  JobCallers& callers_;
  JobRetention& retention_;
  const std::function<double()> seconds_factor_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, Calls> calls_;  // of each tenant, since the start
  std::map<std::string, std::int64_t> refused_by_reason_;
  mutable std::optional<QueueForecast> forecast_;
  mutable absl::Time forecast_time_ = absl::InfinitePast();  // when forecast_ was made, by the steady clock
  mutable absl::Duration forecast_cost_;                     // time that making the forecast took
};

}  // namespace planish
