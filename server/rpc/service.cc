#include "server/rpc/service.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/empty.pb.h"
#include "server/link/rpc_status.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/task_threads.h"
#include "server/rpc/unary_call.h"
#include "server/rpc/upload_reactor.h"
#include "server/rpc/wait_reactor.h"
#include "server/rpc/watch_reactor.h"

namespace planish {
namespace {

// Numbers of threads for calls, by their Work (methods.h).
constexpr int kReadThreads = 4;
constexpr int kWriteThreads = 4;
constexpr int kUploadThreads = 3;

// Largest piece of an upload, if the capabilities do not set it.
constexpr std::int64_t kDefaultChunkBytes = std::int64_t{1} << 20;

constexpr char kFailpointKey[] = "planish-failpoint";

// Default timeout of WaitJob.
constexpr absl::Duration kDefaultWait = absl::Seconds(30);
constexpr absl::Duration kLongestWait = absl::Minutes(1);

// Most bytes in an answer of ReadResult: fits into the messages of 4 MiB that clients accept by default.
constexpr std::int64_t kMostResultBytes = std::int64_t{1} << 20;

// Most entries in a BatchCreateJobs or a FindMissingMeshes.
constexpr int kMostInBatch = 1000;
// Jobs of a batch that are committed together. A sync for each job would take longer than everything else; larger
// transactions would block other writers for longer.
constexpr int kBatchSlice = 50;

absl::Status FieldIsWrong(const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", field}});
}

absl::Status CheckCount(const std::string& field, int count) {
  if (count > 0 && count <= kMostInBatch) return absl::OkStatus();
  return FieldIsWrong(field, absl::StrCat(field, " has ", count, " entries; it may have 1 to ", kMostInBatch));
}

absl::Status CheckView(v1::JobView view) {
  if (v1::JobView_IsValid(view)) return absl::OkStatus();
  return FieldIsWrong("view", absl::StrCat("there is no view ", static_cast<int>(view)));
}

v1::Job InView(v1::Job job, v1::JobView view) {
  if (view == v1::JOB_VIEW_BASIC) job.clear_report();
  return job;
}

// The error of a call that has a JobSpec. Fields get their paths in the request; errors about the mesh name the field
// of the mesh that was given.
absl::Status WithinSpec(const absl::Status& status, v1::JobSpec::MeshCase mesh) {
  if (status.code() != absl::StatusCode::kInvalidArgument) return status;
  ErrorInfo info = ErrorInfoOf(status);
  std::string& field = info.metadata["field"];
  if (field == "request_id") return status;
  if (field.empty() || field == "mesh") {
    const google::protobuf::FieldDescriptor* given = v1::JobSpec::descriptor()->FindFieldByNumber(mesh);
    field = given == nullptr ? "mesh" : given->name();
  }
  field = "spec." + field;
  return MakeError(status.code(), info.reason, std::string(status.message()), info.metadata);
}

absl::Duration FromProto(const google::protobuf::Duration& duration) {
  return absl::Seconds(duration.seconds()) + absl::Nanoseconds(duration.nanos());
}

absl::StatusOr<JobRequest> TakeSpec(const Caller& caller, v1::JobSpec* spec, UploadStore* uploads) {
  UploadedMesh stored;
  if (spec->has_upload()) {
    PLANISH_ASSIGN_OR_RETURN(stored, uploads->Use(caller, spec->upload()));
  } else if (spec->has_mesh_sha256()) {
    PLANISH_ASSIGN_OR_RETURN(stored, uploads->FindMesh(caller, spec->mesh_sha256()));
  }
  PLANISH_ASSIGN_OR_RETURN(JobRequest job, TakeJobRequest(spec));
  job.mesh = std::move(stored.mesh);
  job.mesh_sha256 = std::move(stored.sha256);
  return job;
}

// A BatchCreateJobs call. Between two slices of the batch, other tenants and other calls of the same tenant can run.
class BatchCall : public Call {
 public:
  // Answers the next requests of the batch, up to kBatchSlice.
  using Slice = std::function<void(const CallInfo&, v1::BatchCreateJobsRequest*, v1::BatchCreateJobsResponse*)>;

  BatchCall(CallInfo call, TaskThreads* threads, Slice slice)
      : Call(std::move(call)), tasks_{threads, info().caller.tenant}, slice_(std::move(slice)) {}

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    message_ = std::move(message);
    tasks_.Post([self = shared_from_this(), this] {
      absl::Status status = message_->Parse(&request_);
      if (status.ok()) status = CheckCount("requests", request_.requests_size());
      status.ok() ? Go() : End(status);
    });
  }

  void Go() {
    if (info().context->IsCancelled()) return End(absl::CancelledError("the caller is gone"));
    slice_(info(), &request_, &response_);
    if (response_.results_size() == request_.requests_size()) return EndWith(response_);
    tasks_.Post([self = shared_from_this(), this] { Go(); });
  }

  const TenantTasks tasks_;
  const Slice slice_;
  ReceivedMessagePtr message_;  // holds its share of the memory
  v1::BatchCreateJobsRequest request_;
  v1::BatchCreateJobsResponse response_;
};

class PlanishService : public RpcService {
 public:
  PlanishService(JobManager* manager, UploadStore* uploads, ServiceOptions options, StreamCounter* streams)
      : manager_(manager),
        uploads_(uploads),
        options_(std::move(options)),
        surroundings_{streams, options_.progress_per_second} {
    if (options_.capabilities.upload_chunk_bytes() <= 0) {
      options_.capabilities.set_upload_chunk_bytes(kDefaultChunkBytes);
    }
    Add("Unwrap", [this](CallInfo info) { return Unwrap(std::move(info)); });
    Add("WatchJob", [this](CallInfo info) { return WatchJob(std::move(info)); });
    Add("WaitJob", [this](CallInfo info) { return WaitJob(std::move(info)); });
    Add("WriteUpload", [this](CallInfo info) { return WriteUpload(std::move(info)); });
    Add("BatchCreateJobs", [this](CallInfo info) { return BatchCreateJobs(std::move(info)); });
    Add("CreateJob", &PlanishService::CreateJob);
    Add("FindMissingMeshes", &PlanishService::FindMissingMeshes);
    Add("GetJob", &PlanishService::GetJob);
    Add("ReadResult", &PlanishService::ReadResult);
    Add("ListJobs", &PlanishService::ListJobs);
    Add("StopJob", &PlanishService::StopJob);
    Add("CancelJob", &PlanishService::CancelJob);
    Add("DeleteJob", &PlanishService::DeleteJob);
    Add("EstimateJob", &PlanishService::EstimateJob);
    Add("CreateUpload", &PlanishService::CreateUpload);
    Add("GetUpload", &PlanishService::GetUpload);
    Add("ListUploads", &PlanishService::ListUploads);
    Add("DeleteUpload", &PlanishService::DeleteUpload);
    Add("GetCapabilities", &PlanishService::GetCapabilities);
  }

  const std::vector<Endpoint>& endpoints() const override { return endpoints_; }

 private:
  // ---- streams and long calls

  std::shared_ptr<Call> Unwrap(CallInfo info) {
    const TenantTasks tasks = TasksOf(info);
    JobStream::Position position;
    position.include_uv = true;
    return StreamUnwrap(
        std::move(info),
        [this, position](const CallInfo& call, ReceivedMessage& message) -> absl::StatusOr<OpenedJob> {
          v1::UnwrapRequest request;
          PLANISH_RETURN_IF_ERROR(message.Parse(&request));
          PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, Create(call, request.mutable_spec(), request.request_id(),
                                                                /*attached=*/!request.detached()));
          return OpenedJob{{std::move(accepted.events), std::move(accepted.attachment)}, position};
        },
        {tasks, tasks}, surroundings_);
  }

  std::shared_ptr<Call> WatchJob(CallInfo info) {
    StreamTasks tasks = {TasksOf(info), {&write_threads_, info.caller.tenant}};
    return StreamWatchJob(
        std::move(info),
        [this](const CallInfo& call, ReceivedMessage& message) -> absl::StatusOr<OpenedJob> {
          v1::WatchJobRequest request;
          PLANISH_RETURN_IF_ERROR(message.Parse(&request));
          const JobStream::Position position = {request.after_sequence(), request.include_uv(), request.uv_offset()};
          PLANISH_RETURN_IF_ERROR(Validate(position));
          PLANISH_ASSIGN_OR_RETURN(
              WatchedJob job, manager_->Watch(call.caller, request.name(), request.attach(), request.include_uv()));
          return OpenedJob{std::move(job), position};
        },
        std::move(tasks), surroundings_);
  }

  std::shared_ptr<Call> WaitJob(CallInfo info) {
    TenantTasks tasks = TasksOf(info);
    return AwaitJob(
        std::move(info),
        [this](const CallInfo& call, ReceivedMessage& message) -> absl::StatusOr<WaitedJob> {
          v1::WaitJobRequest request;
          PLANISH_RETURN_IF_ERROR(message.Parse(&request));
          PLANISH_RETURN_IF_ERROR(CheckView(request.view()));
          WaitedJob wait;
          wait.timeout = request.has_timeout() ? std::min(FromProto(request.timeout()), kLongestWait) : kDefaultWait;
          if (wait.timeout < absl::ZeroDuration()) return FieldIsWrong("timeout", "timeout is negative");
          PLANISH_ASSIGN_OR_RETURN(wait.job, manager_->Watch(call.caller, request.name(), /*attach=*/false,
                                                             /*include_uv=*/false));
          wait.get = [this, caller = call.caller, name = request.name(),
                      view = request.view()]() -> absl::StatusOr<v1::Job> {
            PLANISH_ASSIGN_OR_RETURN(v1::Job job, manager_->Get(caller, name, /*may_follow=*/true));
            return InView(std::move(job), view);
          };
          return wait;
        },
        std::move(tasks));
  }

  std::shared_ptr<Call> WriteUpload(CallInfo info) {
    return ReceiveUpload(std::move(info), uploads_, options_.capabilities.upload_chunk_bytes(), &upload_threads_,
                         surroundings_.streams);
  }

  std::shared_ptr<Call> BatchCreateJobs(CallInfo info) {
    return std::make_shared<BatchCall>(
        std::move(info), &write_threads_,
        [this](const CallInfo& call, v1::BatchCreateJobsRequest* request, v1::BatchCreateJobsResponse* response) {
          CreateSlice(call, request, response);
        });
  }

  // ---- calls with one answer

  absl::StatusOr<v1::Job> CreateJob(const CallInfo& call, v1::CreateJobRequest* request) {
    PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted,
                             Create(call, request->mutable_spec(), request->request_id(), /*attached=*/false));
    return std::move(accepted.job);
  }

  absl::StatusOr<v1::FindMissingMeshesResponse> FindMissingMeshes(const CallInfo& call,
                                                                  v1::FindMissingMeshesRequest* request) {
    PLANISH_RETURN_IF_ERROR(CheckCount("sha256", request->sha256_size()));
    const std::vector<std::string> digests(request->sha256().begin(), request->sha256().end());
    PLANISH_ASSIGN_OR_RETURN(const std::vector<std::string> missing, uploads_->FindMissing(call.caller, digests));
    v1::FindMissingMeshesResponse answer;
    answer.mutable_missing_sha256()->Assign(missing.begin(), missing.end());
    return answer;
  }

  absl::StatusOr<v1::Job> GetJob(const CallInfo& call, v1::GetJobRequest* request) {
    PLANISH_RETURN_IF_ERROR(CheckView(request->view()));
    PLANISH_ASSIGN_OR_RETURN(v1::Job job, manager_->Get(call.caller, request->name()));
    return InView(std::move(job), request->view());
  }

  absl::StatusOr<v1::ReadResultResponse> ReadResult(const CallInfo& call, v1::ReadResultRequest* request) {
    if (request->offset() < 0) return FieldIsWrong("offset", "offset is negative");
    if (request->limit() < 0) return FieldIsWrong("limit", "limit is negative");
    PLANISH_ASSIGN_OR_RETURN(JobResult result, manager_->OpenResult(call.caller, request->name()));
    const std::int64_t most = request->limit() == 0 ? kMostResultBytes : std::min(request->limit(), kMostResultBytes);
    v1::ReadResultResponse answer;
    PLANISH_RETURN_IF_ERROR(ReadUv(*result.uv, request->offset(), most, "offset", answer.mutable_data()));
    surroundings_.streams->AddUvBytes(static_cast<std::int64_t>(answer.data().size()));
    *answer.mutable_uv() = std::move(result.description);
    return answer;
  }

  absl::StatusOr<v1::ListJobsResponse> ListJobs(const CallInfo& call, v1::ListJobsRequest* request) {
    PLANISH_RETURN_IF_ERROR(CheckView(request->view()));
    PLANISH_ASSIGN_OR_RETURN(JobPage page, manager_->List(call.caller, *request));
    v1::ListJobsResponse answer;
    answer.mutable_jobs()->Assign(page.jobs.begin(), page.jobs.end());
    answer.set_next_page_token(page.next_page_token);
    return answer;
  }

  absl::StatusOr<v1::Job> StopJob(const CallInfo& call, v1::StopJobRequest* request) {
    return manager_->Stop(call.caller, request->name());
  }

  absl::StatusOr<v1::Job> CancelJob(const CallInfo& call, v1::CancelJobRequest* request) {
    return manager_->Cancel(call.caller, request->name());
  }

  absl::StatusOr<google::protobuf::Empty> DeleteJob(const CallInfo& call, v1::DeleteJobRequest* request) {
    PLANISH_RETURN_IF_ERROR(manager_->Delete(call.caller, request->name()));
    return google::protobuf::Empty();
  }

  absl::StatusOr<v1::JobEstimate> EstimateJob(const CallInfo& call, v1::EstimateJobRequest* request) {
    const v1::JobSpec::MeshCase mesh = request->spec().mesh_case();
    absl::StatusOr<JobRequest> job = TakeSpec(call.caller, request->mutable_spec(), uploads_);
    if (!job.ok()) return WithinSpec(job.status(), mesh);
    absl::StatusOr<v1::JobEstimate> estimate =
        manager_->Estimate(call.caller, *job, request->mesh_bytes(), request->size());
    if (!estimate.ok()) return WithinSpec(estimate.status(), mesh);
    return estimate;
  }

  absl::StatusOr<v1::Upload> CreateUpload(const CallInfo& call, v1::CreateUploadRequest* request) {
    return uploads_->Create(call.caller, *request);
  }

  absl::StatusOr<v1::Upload> GetUpload(const CallInfo& call, v1::GetUploadRequest* request) {
    return uploads_->Get(call.caller, request->name());
  }

  absl::StatusOr<v1::ListUploadsResponse> ListUploads(const CallInfo& call, v1::ListUploadsRequest*) {
    return uploads_->List(call.caller);
  }

  absl::StatusOr<google::protobuf::Empty> DeleteUpload(const CallInfo& call, v1::DeleteUploadRequest* request) {
    PLANISH_RETURN_IF_ERROR(uploads_->Delete(call.caller, request->name()));
    return google::protobuf::Empty();
  }

  absl::StatusOr<v1::Capabilities> GetCapabilities(const CallInfo& call, v1::GetCapabilitiesRequest*) {
    v1::Capabilities capabilities = options_.capabilities;
    if (options_.update_capabilities) options_.update_capabilities(call.caller, &capabilities);
    return capabilities;
  }

  // ---- shared

  absl::StatusOr<AcceptedJob> Create(const CallInfo& call, v1::JobSpec* spec, const std::string& request_id,
                                     bool attached) {
    const v1::JobSpec::MeshCase mesh = spec->mesh_case();
    absl::StatusOr<JobRequest> job = TakeRequest(call, spec, request_id, attached);
    if (!job.ok()) return WithinSpec(job.status(), mesh);
    absl::StatusOr<AcceptedJob> accepted = manager_->Create(call.caller, *std::move(job));
    if (!accepted.ok()) return WithinSpec(accepted.status(), mesh);
    return accepted;
  }

  absl::StatusOr<JobRequest> TakeRequest(const CallInfo& call, v1::JobSpec* spec, const std::string& request_id,
                                         bool attached) {
    PLANISH_ASSIGN_OR_RETURN(JobRequest job, TakeSpec(call.caller, spec, uploads_));
    job.request_id = request_id;
    job.attached = attached;
    job.failpoint = Failpoint(*call.context);
    return job;
  }

  // Creates the next jobs of a batch, which are committed together.
  void CreateSlice(const CallInfo& call, v1::BatchCreateJobsRequest* request, v1::BatchCreateJobsResponse* response) {
    const int begin = response->results_size();
    const int end = std::min(begin + kBatchSlice, request->requests_size());
    std::vector<absl::Status> refused;  // one for each request; OK: the request is one of `jobs`
    std::vector<JobRequest> jobs;
    std::vector<v1::JobSpec::MeshCase> meshes;
    for (int i = begin; i < end; ++i) {
      v1::CreateJobRequest* const each = request->mutable_requests(i);
      meshes.push_back(each->spec().mesh_case());
      absl::StatusOr<JobRequest> job = TakeRequest(call, each->mutable_spec(), each->request_id(), /*attached=*/false);
      refused.push_back(job.status());
      if (job.ok()) jobs.push_back(*std::move(job));
    }
    std::vector<absl::StatusOr<AcceptedJob>> accepted = manager_->CreateAll(call.caller, std::move(jobs));
    auto next = accepted.begin();
    for (int i = begin; i < end; ++i) {
      const auto at = static_cast<std::size_t>(i - begin);
      absl::StatusOr<AcceptedJob> answer =
          refused[at].ok() ? std::move(*next++) : absl::StatusOr<AcceptedJob>(refused[at]);
      v1::BatchCreateJobsResponse::Result* result = response->add_results();
      if (answer.ok()) {
        *result->mutable_job() = InView(std::move(answer->job), v1::JOB_VIEW_BASIC);
      } else {
        *result->mutable_error() =
            ToCallStatus(WithinField(WithinSpec(answer.status(), meshes[at]), absl::StrCat("requests[", i, "].")));
      }
    }
  }

  // The threads that run the call; null: it needs none.
  TaskThreads* ThreadsOf(const Method& method) {
    if (method.work == Work::kNone) return nullptr;
    if (method.work == Work::kMoves) return &upload_threads_;
    return method.work == Work::kReads ? &read_threads_ : &write_threads_;
  }
  TenantTasks TasksOf(const CallInfo& info) { return {ThreadsOf(*info.method), info.caller.tenant}; }

  static const Method& MethodOf(const std::string& name) {
    return MethodAt(absl::StrCat("/planish.v1.Planish/", name));
  }

  void Add(const std::string& name, CallMaker make) { endpoints_.push_back({&MethodOf(name), std::move(make)}); }

  template <class Request, class Response>
  void Add(const std::string& name, absl::StatusOr<Response> (PlanishService::*answer)(const CallInfo&, Request*)) {
    Add(name, MakeUnaryCalls(ThreadsOf(MethodOf(name)),
                             ParsedUnary<Request, Response>([this, answer](const CallInfo& call, Request* request) {
                               return (this->*answer)(call, request);
                             })));
  }

  std::string Failpoint(const grpc::CallbackServerContext& context) const {
    if (!options_.failpoints) return "";
    const auto found = context.client_metadata().find(kFailpointKey);
    return found == context.client_metadata().end() ? "" : std::string(found->second.data(), found->second.size());
  }

  JobManager* const manager_;
  UploadStore* const uploads_;
  ServiceOptions options_;
  std::vector<Endpoint> endpoints_;
  TaskThreads read_threads_{kReadThreads};
  TaskThreads write_threads_{kWriteThreads};
  TaskThreads upload_threads_{kUploadThreads};
  const StreamSurroundings surroundings_;
};

}  // namespace

std::unique_ptr<RpcService> NewPlanishService(JobManager* manager, UploadStore* uploads, ServiceOptions options,
                                              StreamCounter* streams) {
  return std::make_unique<PlanishService>(manager, uploads, std::move(options), streams);
}

}  // namespace planish
