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
#include "planish/v1/planish.grpc.pb.h"
#include "server/link/rpc_status.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/task_threads.h"
#include "server/rpc/trace_header.h"
#include "server/rpc/upload_reactor.h"
#include "server/rpc/wait_reactor.h"
#include "server/rpc/watch_reactor.h"

namespace planish {
namespace {

// Threads for calls that only read from the store, for those that write to it, and for those that move bytes of
// uploads: what is quick does not wait for what is slow.
constexpr int kReadThreads = 4;
constexpr int kWriteThreads = 4;
constexpr int kUploadThreads = 3;

// What a call does to the store.
enum class Access { kReads, kWrites };

// Where a server does not say how much a message may hold.
constexpr std::int64_t kDefaultChunkBytes = std::int64_t{1} << 20;

constexpr char kFailpointKey[] = "planish-failpoint";

// Of a WaitJob.
constexpr absl::Duration kDefaultWait = absl::Seconds(30);
constexpr absl::Duration kLongestWait = absl::Minutes(1);

// Of a ReadResult: fits into the messages of 4 MiB that clients take unless they ask for more.
constexpr std::int64_t kMostResultBytes = std::int64_t{1} << 20;

// Of a BatchCreateJobs and a FindMissingMeshes.
constexpr int kMostInBatch = 1000;
// Jobs of a batch that are committed together: a sync for each would take longer than all the rest, and more of them
// would hold up other writers for longer.
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

// The error of a call that has a JobSpec: fields are named by their paths in the request, and what is wrong with the
// mesh by the kind of mesh that was given.
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

// Takes what is large out of the spec instead of keeping it twice: gRPC keeps the request until the call ends, which
// for Unwrap is as long as the job. The request is gRPC's own object, made non-const, and nobody reads the spec again.
template <class Request>
v1::JobSpec* SpecOf(const Request& request) {
  return const_cast<Request&>(request).mutable_spec();
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

class PlanishService : public v1::Planish::CallbackService {
 public:
  PlanishService(JobManager* manager, UploadStore* uploads, const CallerSource* callers, ServiceOptions options,
                 StreamCounter* streams)
      : manager_(manager),
        uploads_(uploads),
        callers_(callers),
        options_(std::move(options)),
        surroundings_{streams, options_.progress_per_second} {
    if (options_.capabilities.upload_chunk_bytes() <= 0) {
      options_.capabilities.set_upload_chunk_bytes(kDefaultChunkBytes);
    }
  }

  grpc::ServerWriteReactor<v1::UnwrapResponse>* Unwrap(grpc::CallbackServerContext* context,
                                                       const v1::UnwrapRequest* request) override {
    const absl::StatusOr<Caller> caller = Admit(*context, Need::kSubmit);
    JobFinder create = [this, context, request, caller]() -> absl::StatusOr<WatchedJob> {
      PLANISH_RETURN_IF_ERROR(caller.status());
      PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, Create(*caller, *context, SpecOf(*request), request->request_id(),
                                                            !request->detached()));
      return WatchedJob{std::move(accepted.events), std::move(accepted.attachment)};
    };
    JobStream::Position position;
    position.include_uv = true;
    const TenantTasks tasks = TasksOf(caller, Access::kWrites);
    return StreamUnwrap(context, {std::move(create), tasks, tasks}, position, surroundings_);
  }

  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(grpc::CallbackServerContext* context,
                                                           const v1::WatchJobRequest* request) override {
    const JobStream::Position position = {request->after_sequence(), request->include_uv(), request->uv_offset()};
    const absl::StatusOr<Caller> caller = Admit(*context, Need::kNothing);
    JobFinder find = [this, request, caller, position]() -> absl::StatusOr<WatchedJob> {
      PLANISH_RETURN_IF_ERROR(caller.status());
      PLANISH_RETURN_IF_ERROR(CheckOwn(*caller));
      PLANISH_RETURN_IF_ERROR(Validate(position));
      return manager_->Watch(*caller, request->name(), request->attach(), request->include_uv());
    };
    const TenantTasks writes = TasksOf(caller, Access::kWrites);
    const TenantTasks find_on = request->attach() ? writes : TasksOf(caller, Access::kReads);
    return StreamWatchJob(context, {std::move(find), find_on, writes}, position, surroundings_);
  }

  grpc::ServerUnaryReactor* CreateJob(grpc::CallbackServerContext* context, const v1::CreateJobRequest* request,
                                      v1::Job* response) override {
    return Answer(context, Need::kSubmit, Access::kWrites, response,
                  [this, context, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
                    PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, Create(caller, *context, SpecOf(*request),
                                                                          request->request_id(), /*attached=*/false));
                    return std::move(accepted.job);
                  });
  }

  grpc::ServerUnaryReactor* BatchCreateJobs(grpc::CallbackServerContext* context,
                                            const v1::BatchCreateJobsRequest* request,
                                            v1::BatchCreateJobsResponse* response) override {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    absl::StatusOr<Caller> caller = Admit(*context, Need::kSubmit);
    const absl::Status count = CheckCount("requests", request->requests_size());
    if (!caller.ok() || !count.ok()) {
      reactor->Finish(ToGrpcStatus(caller.ok() ? count : caller.status()));
      return reactor;
    }
    CreateSlice({context, request, response, reactor, *std::move(caller)});
    return reactor;
  }

  grpc::ServerUnaryReactor* FindMissingMeshes(grpc::CallbackServerContext* context,
                                              const v1::FindMissingMeshesRequest* request,
                                              v1::FindMissingMeshesResponse* response) override {
    return Answer(context, Need::kSubmit, Access::kReads, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::FindMissingMeshesResponse> {
                    PLANISH_RETURN_IF_ERROR(CheckCount("sha256", request->sha256_size()));
                    const std::vector<std::string> digests(request->sha256().begin(), request->sha256().end());
                    PLANISH_ASSIGN_OR_RETURN(const std::vector<std::string> missing,
                                             uploads_->FindMissing(caller, digests));
                    v1::FindMissingMeshesResponse answer;
                    answer.mutable_missing_sha256()->Assign(missing.begin(), missing.end());
                    return answer;
                  });
  }

  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* context, const v1::GetJobRequest* request,
                                   v1::Job* response) override {
    return Answer(context, Need::kJobs, Access::kReads, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
                    PLANISH_RETURN_IF_ERROR(CheckView(request->view()));
                    PLANISH_ASSIGN_OR_RETURN(v1::Job job, manager_->Get(caller, request->name()));
                    return InView(std::move(job), request->view());
                  });
  }

  grpc::ServerUnaryReactor* WaitJob(grpc::CallbackServerContext* context, const v1::WaitJobRequest* request,
                                    v1::Job* response) override {
    WaitedJob wait;
    wait.timeout = kDefaultWait;
    if (request->has_timeout()) {
      const google::protobuf::Duration& timeout = request->timeout();
      wait.timeout = std::min(absl::Seconds(timeout.seconds()) + absl::Nanoseconds(timeout.nanos()), kLongestWait);
    }
    const absl::StatusOr<Caller> caller = Admit(*context, Need::kNothing);
    wait.find = [this, request, caller, timeout = wait.timeout]() -> absl::StatusOr<WatchedJob> {
      PLANISH_RETURN_IF_ERROR(caller.status());
      PLANISH_RETURN_IF_ERROR(CheckOwn(*caller));
      PLANISH_RETURN_IF_ERROR(CheckView(request->view()));
      if (timeout < absl::ZeroDuration()) return FieldIsWrong("timeout", "timeout is negative");
      return manager_->Watch(*caller, request->name(), /*attach=*/false, /*include_uv=*/false);
    };
    wait.get = [this, request, caller]() -> absl::StatusOr<v1::Job> {
      PLANISH_ASSIGN_OR_RETURN(v1::Job job, manager_->Get(*caller, request->name(), /*may_follow=*/true));
      return InView(std::move(job), request->view());
    };
    return AwaitJob(std::move(wait), TasksOf(caller, Access::kReads), response);
  }

  grpc::ServerUnaryReactor* ReadResult(grpc::CallbackServerContext* context, const v1::ReadResultRequest* request,
                                       v1::ReadResultResponse* response) override {
    return Answer(
        context, Need::kNothing, Access::kReads, response,
        [this, request](const Caller& caller) -> absl::StatusOr<v1::ReadResultResponse> {
          PLANISH_RETURN_IF_ERROR(CheckOwn(caller));
          if (request->offset() < 0) return FieldIsWrong("offset", "offset is negative");
          if (request->limit() < 0) return FieldIsWrong("limit", "limit is negative");
          PLANISH_ASSIGN_OR_RETURN(JobResult result, manager_->OpenResult(caller, request->name()));
          const std::int64_t most =
              request->limit() == 0 ? kMostResultBytes : std::min(request->limit(), kMostResultBytes);
          v1::ReadResultResponse answer;
          PLANISH_RETURN_IF_ERROR(ReadUv(*result.uv, request->offset(), most, "offset", answer.mutable_data()));
          surroundings_.streams->AddUvBytes(static_cast<std::int64_t>(answer.data().size()));
          *answer.mutable_uv() = std::move(result.description);
          return answer;
        });
  }

  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override {
    return Answer(context, Need::kJobs, Access::kReads, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::ListJobsResponse> {
                    PLANISH_RETURN_IF_ERROR(CheckView(request->view()));
                    PLANISH_ASSIGN_OR_RETURN(JobPage page, manager_->List(caller, *request));
                    v1::ListJobsResponse answer;
                    answer.mutable_jobs()->Assign(page.jobs.begin(), page.jobs.end());
                    answer.set_next_page_token(page.next_page_token);
                    return answer;
                  });
  }

  grpc::ServerUnaryReactor* StopJob(grpc::CallbackServerContext* context, const v1::StopJobRequest* request,
                                    v1::Job* response) override {
    return Answer(context, Need::kNothing, Access::kWrites, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
                    PLANISH_RETURN_IF_ERROR(CheckOwn(caller));
                    return manager_->Stop(caller, request->name());
                  });
  }

  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* context, const v1::CancelJobRequest* request,
                                      v1::Job* response) override {
    return Answer(context, Need::kNothing, Access::kWrites, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
                    PLANISH_RETURN_IF_ERROR(CheckOwn(caller));
                    return manager_->Cancel(caller, request->name());
                  });
  }

  grpc::ServerUnaryReactor* DeleteJob(grpc::CallbackServerContext* context, const v1::DeleteJobRequest* request,
                                      google::protobuf::Empty*) override {
    return Answer(context, Need::kJobs, Access::kWrites,
                  [this, request](const Caller& caller) { return manager_->Delete(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* EstimateJob(grpc::CallbackServerContext* context, const v1::EstimateJobRequest* request,
                                        v1::JobEstimate* response) override {
    return Answer(context, Need::kSubmit, Access::kReads, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::JobEstimate> {
                    v1::JobSpec* const spec = SpecOf(*request);
                    const v1::JobSpec::MeshCase mesh = spec->mesh_case();
                    absl::StatusOr<JobRequest> job = TakeSpec(caller, spec, uploads_);
                    if (!job.ok()) return WithinSpec(job.status(), mesh);
                    absl::StatusOr<v1::JobEstimate> estimate =
                        manager_->Estimate(caller, *job, request->mesh_bytes(), request->size());
                    if (!estimate.ok()) return WithinSpec(estimate.status(), mesh);
                    return estimate;
                  });
  }

  grpc::ServerUnaryReactor* CreateUpload(grpc::CallbackServerContext* context, const v1::CreateUploadRequest* request,
                                         v1::Upload* response) override {
    return Answer(context, Need::kSubmit, Access::kWrites, response,
                  [this, request](const Caller& caller) { return uploads_->Create(caller, *request); });
  }

  grpc::ServerReadReactor<v1::WriteUploadRequest>* WriteUpload(grpc::CallbackServerContext* context,
                                                               v1::Upload* response) override {
    return ReceiveUpload(Admit(*context, Need::kSubmit), uploads_, options_.capabilities.upload_chunk_bytes(),
                         &upload_threads_, surroundings_.streams, response);
  }

  grpc::ServerUnaryReactor* GetUpload(grpc::CallbackServerContext* context, const v1::GetUploadRequest* request,
                                      v1::Upload* response) override {
    return Answer(context, Need::kSubmit, Access::kReads, response,
                  [this, request](const Caller& caller) { return uploads_->Get(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* ListUploads(grpc::CallbackServerContext* context, const v1::ListUploadsRequest*,
                                        v1::ListUploadsResponse* response) override {
    return Answer(context, Need::kSubmit, response, [this](const Caller& caller) { return uploads_->List(caller); });
  }

  grpc::ServerUnaryReactor* DeleteUpload(grpc::CallbackServerContext* context, const v1::DeleteUploadRequest* request,
                                         google::protobuf::Empty*) override {
    return Answer(context, Need::kSubmit, Access::kWrites,
                  [this, request](const Caller& caller) { return uploads_->Delete(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* GetCapabilities(grpc::CallbackServerContext* context, const v1::GetCapabilitiesRequest*,
                                            v1::Capabilities* response) override {
    // At once, since clients ask this first: it needs no store.
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    const absl::StatusOr<Caller> caller = Admit(*context, Need::kNothing);
    if (caller.ok()) {
      *response = options_.capabilities;
      if (options_.update_capabilities) options_.update_capabilities(*caller, response);
    }
    reactor->Finish(ToGrpcStatus(caller.status()));
    return reactor;
  }

 private:
  // Of calls by which one follows and ends what one's own Unwrap began: the manager tells whose jobs are whose.
  static absl::Status CheckOwn(const Caller& caller) {
    return caller.rights.submit ? absl::OkStatus() : caller.CheckRight(Need::kJobs);
  }

  absl::StatusOr<AcceptedJob> Create(const Caller& caller, const grpc::CallbackServerContext& context,
                                     v1::JobSpec* spec, const std::string& request_id, bool attached) {
    const v1::JobSpec::MeshCase mesh = spec->mesh_case();
    absl::StatusOr<JobRequest> job = TakeRequest(caller, context, spec, request_id, attached);
    if (!job.ok()) return WithinSpec(job.status(), mesh);
    absl::StatusOr<AcceptedJob> accepted = manager_->Create(caller, *std::move(job));
    if (!accepted.ok()) return WithinSpec(accepted.status(), mesh);
    return accepted;
  }

  absl::StatusOr<JobRequest> TakeRequest(const Caller& caller, const grpc::CallbackServerContext& context,
                                         v1::JobSpec* spec, const std::string& request_id, bool attached) {
    PLANISH_ASSIGN_OR_RETURN(JobRequest job, TakeSpec(caller, spec, uploads_));
    job.request_id = request_id;
    job.attached = attached;
    job.failpoint = Failpoint(context);
    return job;
  }

  // A BatchCreateJobs under way.
  struct Batch {
    grpc::CallbackServerContext* context;
    const v1::BatchCreateJobsRequest* request;
    v1::BatchCreateJobsResponse* response;  // has what was answered so far
    grpc::ServerUnaryReactor* reactor;
    Caller caller;
  };

  // Creates the next jobs of a batch, which are committed together. Other tenants, and other calls of this one, have
  // their turn between two slices.
  void CreateSlice(Batch batch) {
    const TenantTasks tasks = {&write_threads_, batch.caller.tenant};
    tasks.Post([this, batch = std::move(batch)]() mutable {
      if (batch.context->IsCancelled()) return batch.reactor->Finish(grpc::Status::CANCELLED);
      const int begin = batch.response->results_size();
      const int end = std::min(begin + kBatchSlice, batch.request->requests_size());
      std::vector<absl::Status> refused;  // of each; OK: it is one of `jobs`
      std::vector<JobRequest> jobs;
      std::vector<v1::JobSpec::MeshCase> meshes;
      for (int i = begin; i < end; ++i) {
        const v1::CreateJobRequest& each = batch.request->requests(i);
        meshes.push_back(each.spec().mesh_case());
        absl::StatusOr<JobRequest> job =
            TakeRequest(batch.caller, *batch.context, SpecOf(each), each.request_id(), /*attached=*/false);
        refused.push_back(job.status());
        if (job.ok()) jobs.push_back(*std::move(job));
      }
      std::vector<absl::StatusOr<AcceptedJob>> accepted = manager_->CreateAll(batch.caller, std::move(jobs));
      auto next = accepted.begin();
      for (int i = begin; i < end; ++i) {
        const auto at = static_cast<std::size_t>(i - begin);
        absl::StatusOr<AcceptedJob> answer =
            refused[at].ok() ? std::move(*next++) : absl::StatusOr<AcceptedJob>(refused[at]);
        v1::BatchCreateJobsResponse::Result* result = batch.response->add_results();
        if (answer.ok()) {
          *result->mutable_job() = InView(std::move(answer->job), v1::JOB_VIEW_BASIC);
        } else {
          *result->mutable_error() =
              ToCallStatus(WithinField(WithinSpec(answer.status(), meshes[at]), absl::StrCat("requests[", i, "].")));
        }
      }
      if (end == batch.request->requests_size()) return batch.reactor->Finish(grpc::Status::OK);
      CreateSlice(std::move(batch));
    });
  }

  // Whoever makes this call, if they may.
  absl::StatusOr<Caller> Admit(const grpc::CallbackServerContext& context, Need need) const {
    PLANISH_ASSIGN_OR_RETURN(Caller caller, callers_->Identify(context));
    PLANISH_RETURN_IF_ERROR(caller.CheckRight(need));
    caller.traceparent = TraceparentOf(context);
    return caller;
  }

  // Of a caller that was refused: those of nobody.
  TenantTasks TasksOf(const absl::StatusOr<Caller>& caller, Access access) {
    return {access == Access::kReads ? &read_threads_ : &write_threads_, caller.ok() ? caller->tenant : ""};
  }

  // Answers with what `ask`, on a task thread, says to the caller. A call that was cancelled before is skipped.
  template <class Ask>
  grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, Need need, Access access, Ask ask) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    absl::StatusOr<Caller> caller = Admit(*context, need);
    if (!caller.ok()) {
      reactor->Finish(ToGrpcStatus(caller.status()));
      return reactor;
    }
    const TenantTasks tasks = TasksOf(caller, access);
    tasks.Post([context, reactor, caller = *std::move(caller), ask = std::move(ask)] {
      reactor->Finish(context->IsCancelled() ? grpc::Status::CANCELLED : ToGrpcStatus(ask(caller)));
    });
    return reactor;
  }

  template <class Response, class Ask>
  grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, Need need, Access access, Response* response,
                                   Ask ask) {
    return Answer(context, need, access, [response, ask = std::move(ask)](const Caller& caller) -> absl::Status {
      absl::StatusOr<Response> result = ask(caller);
      if (result.ok()) *response = *std::move(result);
      return result.status();
    });
  }

  std::string Failpoint(const grpc::CallbackServerContext& context) const {
    if (!options_.failpoints) return "";
    const auto found = context.client_metadata().find(kFailpointKey);
    return found == context.client_metadata().end() ? "" : std::string(found->second.data(), found->second.size());
  }

  JobManager* const manager_;
  UploadStore* const uploads_;
  const CallerSource* const callers_;
  ServiceOptions options_;
  TaskThreads read_threads_{kReadThreads};
  TaskThreads write_threads_{kWriteThreads};
  TaskThreads upload_threads_{kUploadThreads};
  const StreamSurroundings surroundings_;
};

}  // namespace

std::unique_ptr<grpc::Service> NewPlanishService(JobManager* manager, UploadStore* uploads, const CallerSource* callers,
                                                 ServiceOptions options, StreamCounter* streams) {
  return std::make_unique<PlanishService>(manager, uploads, callers, std::move(options), streams);
}

}  // namespace planish
