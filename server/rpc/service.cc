#include "server/rpc/service.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "planish/v1/planish.grpc.pb.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/task_threads.h"
#include "server/rpc/trace_header.h"
#include "server/rpc/upload_reactor.h"
#include "server/rpc/watch_reactor.h"

namespace planish {
namespace {

// For calls that ask the manager, and for those that move bytes of uploads, so that a few slow senders hold up nobody
// else.
constexpr int kCallThreads = 4;
constexpr int kUploadThreads = 2;

// Where a server does not say how much a message may hold.
constexpr std::int64_t kDefaultChunkBytes = std::int64_t{1} << 20;

constexpr char kFailpointKey[] = "planish-failpoint";

std::vector<std::int32_t> TakeNumbers(google::protobuf::RepeatedField<std::int32_t>* field) {
  google::protobuf::RepeatedField<std::int32_t> taken;
  taken.Swap(field);
  return {taken.begin(), taken.end()};
}

// Takes the mesh and its seams out of the request instead of keeping them twice: gRPC keeps the request until the call
// ends, which for Unwrap is as long as the job. The request is gRPC's own object, made non-const, and nobody reads it
// again.
template <class Request>
absl::StatusOr<JobRequest> TakeRequest(const Caller& caller, const Request* request, UploadStore* uploads) {
  JobRequest job;
  auto* mine = const_cast<Request*>(request);
  job.draco = std::move(*mine->mutable_draco());
  if (!request->upload().empty()) {
    if (!job.draco.empty()) {
      return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                       "the request has a mesh and an upload: which one?", {{"field", "upload"}});
    }
    PLANISH_ASSIGN_OR_RETURN(UploadedMesh uploaded, uploads->Use(caller, request->upload()));
    job.mesh = std::move(uploaded.mesh);
    job.mesh_sha256 = std::move(uploaded.sha256);
  }
  job.seam_corners = TakeNumbers(mine->mutable_seam_corners());
  job.uncut_corners = TakeNumbers(mine->mutable_uncut_corners());
  job.options = request->options();
  job.scheduling = request->scheduling();
  job.request_id = request->request_id();
  job.label = request->label();
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
        surroundings_{streams, &call_threads_, options_.progress_per_second} {
    if (options_.capabilities.upload_chunk_bytes() <= 0) {
      options_.capabilities.set_upload_chunk_bytes(kDefaultChunkBytes);
    }
  }

  grpc::ServerWriteReactor<v1::UnwrapResponse>* Unwrap(grpc::CallbackServerContext* context,
                                                       const v1::UnwrapRequest* request) override {
    JobFinder create = [this, context, request]() -> absl::StatusOr<WatchedJob> {
      PLANISH_ASSIGN_OR_RETURN(const Caller caller, Admit(*context, Need::kSubmit));
      PLANISH_ASSIGN_OR_RETURN(JobRequest job, TakeRequest(caller, request, uploads_));
      job.attached = !request->detached();
      job.failpoint = Failpoint(*context);
      PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, manager_->Create(caller, std::move(job)));
      return WatchedJob{std::move(accepted.events), std::move(accepted.attachment)};
    };
    JobStream::Position position;
    position.include_uv = true;
    return StreamUnwrap(context, std::move(create), position, surroundings_);
  }

  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(grpc::CallbackServerContext* context,
                                                           const v1::WatchJobRequest* request) override {
    const JobStream::Position position = {request->after_sequence(), request->include_uv(), request->uv_offset()};
    JobFinder find = [this, context, request, position]() -> absl::StatusOr<WatchedJob> {
      PLANISH_ASSIGN_OR_RETURN(const Caller caller, Admit(*context, Need::kNothing));
      PLANISH_RETURN_IF_ERROR(CheckOwn(caller));
      PLANISH_RETURN_IF_ERROR(Validate(position));
      return manager_->Watch(caller, request->name(), request->attach(), request->include_uv());
    };
    return StreamWatchJob(context, std::move(find), position, surroundings_);
  }

  grpc::ServerUnaryReactor* CreateJob(grpc::CallbackServerContext* context, const v1::CreateJobRequest* request,
                                      v1::Job* response) override {
    return Answer(context, Need::kSubmit, response,
                  [this, context, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
                    PLANISH_ASSIGN_OR_RETURN(JobRequest job, TakeRequest(caller, request, uploads_));
                    job.failpoint = Failpoint(*context);
                    PLANISH_ASSIGN_OR_RETURN(AcceptedJob accepted, manager_->Create(caller, std::move(job)));
                    return std::move(accepted.job);
                  });
  }

  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* context, const v1::GetJobRequest* request,
                                   v1::Job* response) override {
    return Answer(context, Need::kJobs, response,
                  [this, request](const Caller& caller) { return manager_->Get(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override {
    return Answer(context, Need::kJobs, response,
                  [this, request](const Caller& caller) -> absl::StatusOr<v1::ListJobsResponse> {
                    PLANISH_ASSIGN_OR_RETURN(JobPage page, manager_->List(caller, *request));
                    v1::ListJobsResponse answer;
                    answer.mutable_jobs()->Assign(page.jobs.begin(), page.jobs.end());
                    answer.set_next_page_token(page.next_page_token);
                    return answer;
                  });
  }

  grpc::ServerUnaryReactor* StopJob(grpc::CallbackServerContext* context, const v1::StopJobRequest* request,
                                    v1::Job* response) override {
    return Answer(context, Need::kNothing, response, [this, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
      PLANISH_RETURN_IF_ERROR(CheckOwn(caller));
      return manager_->Stop(caller, request->name());
    });
  }

  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* context, const v1::CancelJobRequest* request,
                                      v1::Job* response) override {
    return Answer(context, Need::kNothing, response, [this, request](const Caller& caller) -> absl::StatusOr<v1::Job> {
      PLANISH_RETURN_IF_ERROR(CheckOwn(caller));
      return manager_->Cancel(caller, request->name());
    });
  }

  grpc::ServerUnaryReactor* DeleteJob(grpc::CallbackServerContext* context, const v1::DeleteJobRequest* request,
                                      google::protobuf::Empty*) override {
    return Answer(context, Need::kJobs,
                  [this, request](const Caller& caller) { return manager_->Delete(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* EstimateJob(grpc::CallbackServerContext* context, const v1::EstimateJobRequest* request,
                                        v1::JobEstimate* response) override {
    return Answer(context, Need::kSubmit, response,
                  [this, request](const Caller& caller) { return manager_->Estimate(caller, *request); });
  }

  grpc::ServerUnaryReactor* CreateUpload(grpc::CallbackServerContext* context, const v1::CreateUploadRequest* request,
                                         v1::Upload* response) override {
    return Answer(context, Need::kSubmit, response,
                  [this, request](const Caller& caller) { return uploads_->Create(caller, *request); });
  }

  grpc::ServerReadReactor<v1::WriteUploadRequest>* WriteUpload(grpc::CallbackServerContext* context,
                                                               v1::Upload* response) override {
    return ReceiveUpload(Admit(*context, Need::kSubmit), uploads_, options_.capabilities.upload_chunk_bytes(),
                         &upload_threads_, response);
  }

  grpc::ServerUnaryReactor* GetUpload(grpc::CallbackServerContext* context, const v1::GetUploadRequest* request,
                                      v1::Upload* response) override {
    return Answer(context, Need::kSubmit, response,
                  [this, request](const Caller& caller) { return uploads_->Get(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* DeleteUpload(grpc::CallbackServerContext* context, const v1::DeleteUploadRequest* request,
                                         google::protobuf::Empty*) override {
    return Answer(context, Need::kSubmit,
                  [this, request](const Caller& caller) { return uploads_->Delete(caller, request->name()); });
  }

  grpc::ServerUnaryReactor* GetCapabilities(grpc::CallbackServerContext* context, const v1::GetCapabilitiesRequest*,
                                            v1::Capabilities* response) override {
    return Answer(context, Need::kNothing, response, [this](const Caller& caller) -> absl::StatusOr<v1::Capabilities> {
      v1::Capabilities capabilities = options_.capabilities;
      if (options_.update_capabilities) options_.update_capabilities(caller, &capabilities);
      return capabilities;
    });
  }

 private:
  // Of calls by which one follows and ends what one's own Unwrap began: the manager tells whose jobs are whose.
  static absl::Status CheckOwn(const Caller& caller) {
    return caller.rights.submit ? absl::OkStatus() : caller.CheckRight(Need::kJobs);
  }

  // Whoever makes this call, if they may.
  absl::StatusOr<Caller> Admit(const grpc::CallbackServerContext& context, Need need) const {
    PLANISH_ASSIGN_OR_RETURN(Caller caller, callers_->Identify(context));
    PLANISH_RETURN_IF_ERROR(caller.CheckRight(need));
    caller.traceparent = TraceparentOf(context);
    return caller;
  }

  // Answers with what `ask`, on a task thread, says to the caller.
  template <class Ask>
  grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, Need need, Ask ask) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    call_threads_.Post([this, context, need, reactor, ask = std::move(ask)] {
      const absl::StatusOr<Caller> caller = Admit(*context, need);
      reactor->Finish(ToGrpcStatus(caller.ok() ? ask(*caller) : caller.status()));
    });
    return reactor;
  }

  template <class Response, class Ask>
  grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, Need need, Response* response, Ask ask) {
    return Answer(context, need, [response, ask = std::move(ask)](const Caller& caller) -> absl::Status {
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
  TaskThreads call_threads_{kCallThreads};
  TaskThreads upload_threads_{kUploadThreads};
  const StreamSurroundings surroundings_;
};

}  // namespace

std::unique_ptr<grpc::Service> NewPlanishService(JobManager* manager, UploadStore* uploads, const CallerSource* callers,
                                                 ServiceOptions options, StreamCounter* streams) {
  return std::make_unique<PlanishService>(manager, uploads, callers, std::move(options), streams);
}

}  // namespace planish
