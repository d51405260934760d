#include "server/rpc/service.h"

#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/error.h"
#include "planish/v1/planish.grpc.pb.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/job_stream.h"

namespace planish {
namespace {

// Sends a JobStream with one write under way at a time: a slow reader leaves events in the log, where old progress
// gives way to new, and holds up nobody. Owns itself until gRPC is done with it.
template <class Response>
class StreamReactor : public grpc::ServerWriteReactor<Response>,
                      public std::enable_shared_from_this<StreamReactor<Response>> {
 public:
  static StreamReactor* Start(std::shared_ptr<const JobEventLog> events, const JobStream::Position& position,
                              JobAttachment attachment, StreamCounter* streams) {
    auto reactor = std::make_shared<StreamReactor>(events, position, std::move(attachment), streams);
    reactor->self_ = reactor;
    const std::weak_ptr<StreamReactor> weak = reactor;
    reactor->subscription_ = events->Subscribe([weak] {
      if (const auto alive = weak.lock()) alive->Pump();
    });
    reactor->Pump();
    return reactor.get();
  }

  StreamReactor(std::shared_ptr<const JobEventLog> events, const JobStream::Position& position,
                JobAttachment attachment, StreamCounter* streams)
      : streams_(streams), stream_(std::move(events), position), attachment_(std::move(attachment)) {
    streams_->Add();
  }

  ~StreamReactor() override { streams_->Remove(); }

  void OnWriteDone(bool ok) override {
    {
      const std::lock_guard lock(mutex_);
      busy_ = false;
      gone_ = gone_ || !ok;
    }
    Pump();
  }

  // The caller went away or its deadline passed.
  void OnCancel() override {
    {
      const std::lock_guard lock(mutex_);
      gone_ = true;
    }
    attachment_.Release();
    Pump();
  }

  void OnDone() override {
    subscription_.reset();
    attachment_.Release();
    self_.reset();
  }

 private:
  // Starts the next operation if none is under way. Any thread.
  void Pump() {
    JobStream::Step step = JobStream::Step::kEnd;
    grpc::Status status;
    {
      const std::lock_guard lock(mutex_);
      if (busy_) return;
      if (gone_) {
        status = grpc::Status::CANCELLED;
      } else {
        response_.Clear();
        step = NextStep();
        if (step == JobStream::Step::kWait) return;
        status = ToGrpcStatus(stream_.status());
      }
      busy_ = true;  // for good if this is the end
    }
    // Outside the lock: gRPC may react on this very thread. After Finish() `this` may be gone.
    if (step == JobStream::Step::kEnd) {
      this->Finish(std::move(status));
    } else {
      this->StartWrite(&response_);
    }
  }

  // Requires mutex_.
  JobStream::Step NextStep() {
    v1::JobEvent event;
    v1::UvChunk chunk;
    const JobStream::Step step = stream_.Next(&event, &chunk);
    if (step == JobStream::Step::kEvent) *response_.mutable_event() = std::move(event);
    if (step == JobStream::Step::kUv) *response_.mutable_uv() = std::move(chunk);
    return step;
  }

  StreamCounter* const streams_;

  // Set by Start(), dropped by OnDone().
  std::shared_ptr<StreamReactor> self_;
  JobEventLog::Subscription subscription_;

  std::mutex mutex_;
  // Guarded by mutex_; response_ belongs to gRPC while busy_.
  JobStream stream_;
  Response response_;
  bool busy_ = false;
  bool gone_ = false;

  // Touched by OnCancel(), then OnDone(), which gRPC never runs at the same time.
  JobAttachment attachment_;
};

template <class Response>
class FailedStream : public grpc::ServerWriteReactor<Response> {
 public:
  explicit FailedStream(const absl::Status& status) { this->Finish(ToGrpcStatus(status)); }
  void OnDone() override { delete this; }
};

grpc::ServerUnaryReactor* Finish(grpc::CallbackServerContext* context, const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(ToGrpcStatus(status));
  return reactor;
}

template <class Message>
grpc::ServerUnaryReactor* Finish(grpc::CallbackServerContext* context, absl::StatusOr<Message> result,
                                 Message* response) {
  if (result.ok()) *response = *std::move(result);
  return Finish(context, result.status());
}

std::vector<std::int32_t> TakeNumbers(google::protobuf::RepeatedField<std::int32_t>* field) {
  google::protobuf::RepeatedField<std::int32_t> taken;
  taken.Swap(field);
  return {taken.begin(), taken.end()};
}

// Takes the mesh and its seams out of the request instead of keeping them twice: gRPC keeps the request until the call
// ends, which for Unwrap is as long as the job. The request is gRPC's own object, made non-const, and nobody reads it
// again.
template <class Request>
JobRequest TakeRequest(const Request* request) {
  JobRequest job;
  auto* mine = const_cast<Request*>(request);
  job.draco = std::move(*mine->mutable_draco());
  job.seam_corners = TakeNumbers(mine->mutable_seam_corners());
  job.uncut_corners = TakeNumbers(mine->mutable_uncut_corners());
  job.options = request->options();
  job.request_id = request->request_id();
  job.label = request->label();
  return job;
}

class PlanishService : public v1::Planish::CallbackService {
 public:
  PlanishService(JobManager* manager, v1::Capabilities capabilities, StreamCounter* streams)
      : manager_(manager), capabilities_(std::move(capabilities)), streams_(streams) {}

  grpc::ServerWriteReactor<v1::UnwrapResponse>* Unwrap(grpc::CallbackServerContext*,
                                                       const v1::UnwrapRequest* request) override {
    JobRequest job = TakeRequest(request);
    job.attached = !request->detached();
    absl::StatusOr<AcceptedJob> accepted = manager_->Create(std::move(job));
    if (!accepted.ok()) return new FailedStream<v1::UnwrapResponse>(accepted.status());
    JobStream::Position position;
    position.include_uv = true;
    return StreamReactor<v1::UnwrapResponse>::Start(accepted->events, position, std::move(accepted->attachment),
                                                    streams_);
  }

  grpc::ServerUnaryReactor* CreateJob(grpc::CallbackServerContext* context, const v1::CreateJobRequest* request,
                                      v1::Job* response) override {
    absl::StatusOr<AcceptedJob> accepted = manager_->Create(TakeRequest(request));
    if (accepted.ok()) *response = std::move(accepted->job);
    return Finish(context, accepted.status());
  }

  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* context, const v1::GetJobRequest* request,
                                   v1::Job* response) override {
    return Finish(context, manager_->Get(request->name()), response);
  }

  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override {
    absl::StatusOr<JobPage> page = manager_->List(request->page_size(), request->page_token(), request->state());
    if (!page.ok()) return Finish(context, page.status());
    response->mutable_jobs()->Assign(page->jobs.begin(), page->jobs.end());
    response->set_next_page_token(page->next_page_token);
    return Finish(context, absl::OkStatus());
  }

  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(grpc::CallbackServerContext*,
                                                           const v1::WatchJobRequest* request) override {
    const JobStream::Position position = {request->after_sequence(), request->include_uv(), request->uv_offset()};
    if (const absl::Status status = Validate(position); !status.ok()) {
      return new FailedStream<v1::WatchJobResponse>(status);
    }
    auto events = manager_->Watch(request->name());
    if (!events.ok()) return new FailedStream<v1::WatchJobResponse>(events.status());
    return StreamReactor<v1::WatchJobResponse>::Start(*std::move(events), position, JobAttachment(), streams_);
  }

  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* context, const v1::CancelJobRequest* request,
                                      v1::Job* response) override {
    return Finish(context, manager_->Cancel(request->name()), response);
  }

  grpc::ServerUnaryReactor* DeleteJob(grpc::CallbackServerContext* context, const v1::DeleteJobRequest* request,
                                      google::protobuf::Empty*) override {
    return Finish(context, manager_->Delete(request->name()));
  }

  grpc::ServerUnaryReactor* GetCapabilities(grpc::CallbackServerContext* context, const v1::GetCapabilitiesRequest*,
                                            v1::Capabilities* response) override {
    *response = capabilities_;
    return Finish(context, absl::OkStatus());
  }

 private:
  JobManager* const manager_;
  const v1::Capabilities capabilities_;
  StreamCounter* const streams_;
};

}  // namespace

std::unique_ptr<grpc::Service> NewPlanishService(JobManager* manager, v1::Capabilities capabilities,
                                                 StreamCounter* streams) {
  return std::make_unique<PlanishService>(manager, std::move(capabilities), streams);
}

}  // namespace planish
