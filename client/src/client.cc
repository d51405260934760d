#include "planish/client.h"

#include <algorithm>
#include <future>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "client/src/convert.h"
#include "client/src/errors.h"
#include "client/src/follower.h"
#include "client/src/mesh_packer.h"
#include "client/src/rpc.h"
#include "core/base/random_id.h"
#include "core/base/trace_context.h"

namespace planish::inline abi0 {
namespace {

using Clock = std::chrono::steady_clock;
using Stub = v1::Planish::Stub;

// Bytes of a Draco file that are sent with EstimateJob: the beginning of the file declares the size of the mesh.
constexpr std::size_t kEstimateBytes = 1024;

// Limits of one BatchCreateJobs: number of jobs, and bytes of their meshes. A larger mesh is sent on its own, by a
// resumable upload.
constexpr std::size_t kMostInBatch = 100;
constexpr std::size_t kMostBatchBytes = std::size_t{1} << 20;

// Limit of one WaitJob, short enough that proxies do not take it for a dead connection.
constexpr Seconds kLongestWait{15};

// A request with everything but the mesh's bytes.
template <typename Request>
Request NewJobRequest(const PackedMesh& mesh, const UnwrapOptions& options, const CallOptions& call) {
  Request request;
  v1::JobSpec& spec = *request.mutable_spec();
  *spec.mutable_elements() = mesh.elements;
  *spec.mutable_options() = ToProto(options);
  *spec.mutable_scheduling() = ToProto(call.scheduling);
  spec.mutable_labels()->insert(call.labels.begin(), call.labels.end());
  request.set_request_id(call.request_id.empty() ? NewUuid() : call.request_id);
  return request;
}

// The UV of an ended job, or the error that explains why it has none.
UnwrapResult ResultOf(const Followed& followed, const PackedMesh& mesh, Clock::time_point start) try {
  const v1::Job& job = followed.job;
  if (job.state() == v1::JOB_STATE_FAILED && job.has_error()) {
    throw Renumbered(ErrorFrom(job.error()), mesh.ToCaller());
  }
  if (job.state() == v1::JOB_STATE_CANCELLED) {
    throw Error(ErrorCode::kCancelled, "CANCELLED", "the job was cancelled");
  }
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    const std::string state = v1::JobState_Name(job.state());
    throw Error(ErrorCode::kInternal, "INTERNAL", "the job ended as " + state + " without a word");
  }
  UnwrapResult result;
  result.job = job.name();
  result.trace_id = TraceIdOf(job.traceparent());
  result.uv = ParseUv(job.uv(), followed.uv_bytes, mesh);
  result.report = FromProto(job.report(), mesh.ToCaller());
  result.report.times.upload = followed.upload_time;
  result.report.times.download = followed.download_time;
  result.report.times.total = Clock::now() - start;
  return result;
} catch (Error& error) {
  throw error.set_job(followed.job.name());
}

// Calls work(call) with the traceparent of one trace for all of its calls. Returns the result of `work`, or its error
// with the trace's id.
template <typename Work>
Result<std::invoke_result_t<Work, CallOptions>> Traced(CallOptions call, const Work& work) {
  auto result = Caught([&] {
    call.traceparent = TraceOf(call.traceparent);
    return work(call);
  });
  if (result.ok()) return result;
  return Error(result.error()).set_trace_id(std::string(TraceIdOf(call.traceparent)));
}

}  // namespace

struct Client::Impl {
  Rpc rpc;

  // `start`: the time of the caller's call, before the mesh was packed.
  UnwrapResult Unwrap(PackedMesh mesh, Clock::time_point start, const UnwrapOptions& options,
                      const Callbacks& callbacks, const CallOptions& call, std::stop_token finish = {},
                      std::function<void(const std::string&)> on_job_name = {}) {
    const Seconds packing_time = Clock::now() - start;
    auto request = NewJobRequest<v1::UnwrapRequest>(mesh, options, call);
    request.set_detached(call.detached);
    Follower follower(rpc, call, callbacks, &mesh, std::move(finish), std::move(on_job_name));
    UnwrapResult result = ResultOf(follower.Unwrap(std::move(request)), mesh, start);
    result.report.times.upload += packing_time;
    result.trace_id = TraceIdOf(call.traceparent);
    return result;
  }

  Job Create(PackedMesh mesh, const UnwrapOptions& options, const CallOptions& call) {
    auto request = NewJobRequest<v1::CreateJobRequest>(mesh, options, call);
    const Callbacks none;
    return FromProto(Follower(rpc, call, none, &mesh).Create(std::move(request)));
  }

  JobEstimate Estimate(v1::EstimateJobRequest request, const UnwrapOptions& options) {
    *request.mutable_spec()->mutable_options() = ToProto(options);
    return FromProto(rpc.Repeat(&Stub::EstimateJob, request));
  }

  // A job of CreateMany() that has not been accepted yet.
  struct Pending {
    PackedMesh mesh;
    const NewJob* job;
    Result<Job>* result;
    bool is_known = false;  // whether the server has the mesh already
  };

  std::vector<Result<Job>> CreateMany(std::span<const NewJob> jobs, const std::string& trace) {
    const Error unanswered(ErrorCode::kInternal, "INTERNAL", "the server did not answer to this job");
    std::vector<Result<Job>> results(jobs.size(), unanswered);
    for (std::size_t i = 0; i < jobs.size();) {
      // Only the meshes of one call are in memory at a time.
      std::vector<Pending> batch;
      for (std::size_t bytes = 0; i < jobs.size() && batch.size() < kMostInBatch && bytes < kMostBatchBytes; ++i) {
        Result<PackedMesh> mesh = Caught([&] { return PackedMesh::Of(jobs[i].mesh); });
        if (!mesh.ok()) {
          results[i] = mesh.error();
          continue;
        }
        bytes += mesh->draco.size();
        batch.push_back({*std::move(mesh), &jobs[i], &results[i]});
      }
      if (!batch.empty()) CreateBatch(std::move(batch), trace);
    }
    return results;
  }

  void CreateBatch(std::vector<Pending> batch, const std::string& trace) {
    v1::FindMissingMeshesRequest digests;
    for (const Pending& each : batch) digests.add_sha256(each.mesh.sha256);
    const auto answer = rpc.Repeat(&Stub::FindMissingMeshes, digests, trace);
    const std::set<std::string> missing(answer.missing_sha256().begin(), answer.missing_sha256().end());
    std::vector<Pending*> together, alone;
    v1::BatchCreateJobsRequest request;
    for (Pending& each : batch) {
      each.is_known = !missing.contains(each.mesh.sha256);
      if (!each.is_known && each.mesh.draco.size() > kMostBatchBytes) {
        alone.push_back(&each);
        continue;
      }
      together.push_back(&each);
      auto& one = *request.add_requests();
      one = NewJobRequest<v1::CreateJobRequest>(each.mesh, each.job->options, each.job->call);
      if (each.is_known) {
        one.mutable_spec()->set_mesh_sha256(each.mesh.sha256);
      } else {
        one.mutable_spec()->set_draco(std::move(each.mesh.draco));
      }
    }
    v1::BatchCreateJobsResponse response;
    // The request ids make retries safe.
    if (!together.empty()) response = rpc.Repeat(&Stub::BatchCreateJobs, request, trace);
    const std::size_t answers = std::min(together.size(), static_cast<std::size_t>(response.results_size()));
    for (std::size_t i = 0; i < answers; ++i) {
      const auto& result = response.results(static_cast<int>(i));
      if (result.has_job()) {
        *together[i]->result = FromProto(result.job());
        continue;
      }
      const Error error = Renumbered(ErrorFrom(result.error()), together[i]->mesh.ToCaller());
      *together[i]->result = error;
      if (together[i]->is_known && error.reason() == "MESH_NOT_FOUND") alone.push_back(together[i]);
    }
    for (Pending* each : alone) {
      CallOptions call = each->job->call;
      call.traceparent = trace;
      *each->result = Caught([&] { return Create(std::move(each->mesh), each->job->options, call); });
    }
  }
};

struct Call::State {
  // The name of the job. Shared with the thread, which may outlive the Call.
  struct JobName {
    std::mutex mutex;
    std::string text;  // guarded by mutex
  };

  ~State() {
    stop.request_stop();
    if (thread.get_id() == std::this_thread::get_id()) {
      thread.detach();  // a callback of this call destroys the call
    } else if (thread.joinable()) {
      thread.join();
    }
  }

  std::stop_source stop;    // of Cancel()
  std::stop_source finish;  // of Stop()
  const std::shared_ptr<JobName> job = std::make_shared<JobName>();
  std::future<Result<UnwrapResult>> result;
  std::thread thread;
};

void Call::Cancel() {
  if (state_ != nullptr) state_->stop.request_stop();
}

void Call::Stop() {
  if (state_ != nullptr) state_->finish.request_stop();
}

std::string Call::job() const {
  if (state_ == nullptr) return {};
  const std::lock_guard lock(state_->job->mutex);
  return state_->job->text;
}

bool Call::WaitFor(Seconds timeout) const {
  return state_ == nullptr || !state_->result.valid() || state_->result.wait_for(timeout) == std::future_status::ready;
}

Result<UnwrapResult> Call::Wait(std::nothrow_t) {
  if (state_ != nullptr && state_->result.valid()) return state_->result.get();
  return Error(ErrorCode::kFailedPrecondition, "CALL_EMPTY", "this call was never started, or has been waited for");
}

Client::Client(const std::string& target, const ClientOptions& options) : impl_(new Impl{{target, options}}) {}

Result<Client> Client::Make(const std::string& target, const ClientOptions& options) {
  return Caught([&] { return Client(target, options); });
}

const std::string& Client::target() const {
  return impl_->rpc.target();
}

Result<UnwrapResult> Client::Unwrap(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options,
                                    const Callbacks& callbacks, const CallOptions& call) {
  return Traced(call, [&, start = Clock::now()](const CallOptions& traced) {
    return impl_->Unwrap(PackedMesh::Of(mesh), start, options, callbacks, traced);
  });
}

Result<Call> Client::StartUnwrap(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options,
                                 Callbacks callbacks, CallOptions call) {
  const Clock::time_point start = Clock::now();
  return Caught([&] {
    auto state = std::make_shared<Call::State>();
    // The caller's stop token works like Call::Cancel().
    auto callers_stop = std::make_shared<std::stop_callback<std::function<void()>>>(
        call.stop, [stop = state->stop]() mutable { stop.request_stop(); });
    call.stop = state->stop.get_token();
    std::packaged_task<Result<UnwrapResult>()> task(
        [impl = impl_, job = state->job, finish = state->finish.get_token(), callers_stop, start,
         packed = PackedMesh::Of(mesh), options, callbacks = std::move(callbacks), call = std::move(call)]() mutable {
          const auto on_job_name = [&](const std::string& name) {
            const std::lock_guard lock(job->mutex);
            job->text = name;
          };
          Result<UnwrapResult> result = Traced(call, [&](const CallOptions& traced) {
            UnwrapResult brought =
                impl->Unwrap(std::move(packed), start, options, callbacks, traced, finish, on_job_name);
            if (callbacks.on_done) callbacks.on_done(brought);
            return brought;
          });
          if (result.ok() || !callbacks.on_error) return result;
          const Result<void> told = Caught([&] { callbacks.on_error(result.error()); });
          return told.ok() ? result : told.error();
        });
    state->result = task.get_future();
    state->thread = std::thread(std::move(task));
    return Call(state);
  });
}

Result<Job> Client::CreateJob(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options,
                              const CallOptions& call) {
  return Traced(call, [&](const CallOptions& traced) { return impl_->Create(PackedMesh::Of(mesh), options, traced); });
}

Result<std::vector<Result<Job>>> Client::CreateJobs(std::nothrow_t, std::span<const NewJob> jobs) {
  return Traced({}, [&](const CallOptions& traced) { return impl_->CreateMany(jobs, traced.traceparent); });
}

Result<UnwrapResult> Client::AttachResult(std::nothrow_t, const std::string& job, const MeshView& mesh,
                                          const Callbacks& callbacks, const CallOptions& call) {
  return Traced(call, [&, start = Clock::now()](const CallOptions& traced) {
    PackedMesh packed = PackedMesh::Of(mesh);
    UnwrapResult result = ResultOf(Follower(impl_->rpc, traced, callbacks, &packed).Watch(job, 0), packed, start);
    result.report.times.upload = {};
    return result;
  });
}

Result<Job> Client::WatchJob(std::nothrow_t, const std::string& job, const Callbacks& callbacks,
                             std::int64_t after_sequence, const CallOptions& call) {
  return Traced(call, [&](const CallOptions& traced) {
    return FromProto(Follower(impl_->rpc, traced, callbacks, nullptr).Watch(job, after_sequence).job);
  });
}

Result<Job> Client::GetJob(std::nothrow_t, const std::string& job) {
  return Caught([&] { return FromProto(impl_->rpc.Repeat(&Stub::GetJob, Named<v1::GetJobRequest>(job))); });
}

Result<Job> Client::WaitJob(std::nothrow_t, const std::string& job, Seconds timeout) {
  const Clock::time_point start = Clock::now();
  return Caught([&] {
    auto request = Named<v1::WaitJobRequest>(job);
    while (true) {
      const Seconds left = timeout > Seconds(0) ? Seconds(timeout - (Clock::now() - start)) : kLongestWait;
      *request.mutable_timeout() = ToProto(std::clamp(left, Seconds(0), kLongestWait));
      Job waited = FromProto(impl_->rpc.Repeat(&Stub::WaitJob, request));
      if (IsTerminal(waited.state) || (timeout > Seconds(0) && Clock::now() - start >= timeout)) return waited;
    }
  });
}

Result<std::string> Client::ReadResult(std::nothrow_t, const std::string& job, std::int64_t offset, std::int64_t size) {
  return Caught([&] {
    std::string bytes;
    auto request = Named<v1::ReadResultRequest>(job);
    for (std::int64_t have = 0; have < size; have = static_cast<std::int64_t>(bytes.size())) {
      request.set_offset(offset + have);
      request.set_limit(size - have);
      const v1::ReadResultResponse piece = impl_->rpc.Repeat(&Stub::ReadResult, request);
      if (piece.data().empty()) break;
      bytes += piece.data();
    }
    return bytes;
  });
}

Result<std::vector<Job>> Client::ListJobs(std::nothrow_t, int limit, const std::string& filter) {
  return Caught([&] {
    constexpr int kPageSize = 1000;
    std::vector<Job> jobs;
    v1::ListJobsRequest request;
    request.set_filter(filter);
    do {
      const int left = limit > 0 ? limit - static_cast<int>(jobs.size()) : kPageSize;
      request.set_page_size(std::min(left, kPageSize));
      const v1::ListJobsResponse response = impl_->rpc.Repeat(&Stub::ListJobs, request);
      for (const v1::Job& job : response.jobs()) jobs.push_back(FromProto(job));
      // The next page must come from the same server, because other servers do not know this page token.
      request.set_page_token(response.next_page_token());
    } while (!request.page_token().empty() && (limit <= 0 || static_cast<int>(jobs.size()) < limit));
    return jobs;
  });
}

Result<Job> Client::StopJob(std::nothrow_t, const std::string& job) {
  return Caught([&] { return FromProto(impl_->rpc.Repeat(&Stub::StopJob, Named<v1::StopJobRequest>(job))); });
}

Result<Job> Client::CancelJob(std::nothrow_t, const std::string& job) {
  return Caught([&] { return FromProto(impl_->rpc.Repeat(&Stub::CancelJob, Named<v1::CancelJobRequest>(job))); });
}

Result<void> Client::DeleteJob(std::nothrow_t, const std::string& job) {
  return Caught([&] {
    int attempts = 0;
    try {
      impl_->rpc.Repeat(&Stub::DeleteJob, Named<v1::DeleteJobRequest>(job), TraceOf(""), &attempts);
    } catch (const Error& error) {
      // NOT_FOUND after a retry: an earlier attempt succeeded, and only its answer was lost.
      if (attempts == 1 || error.code() != ErrorCode::kNotFound) throw;
    }
  });
}

Result<JobEstimate> Client::Estimate(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options) {
  return Caught([&] {
    const std::string draco = PackedMesh::Of(mesh).draco;
    v1::EstimateJobRequest request;
    request.mutable_spec()->set_draco(draco.substr(0, kEstimateBytes));
    request.set_mesh_bytes(static_cast<std::int64_t>(draco.size()));
    return impl_->Estimate(std::move(request), options);
  });
}

Result<JobEstimate> Client::Estimate(std::nothrow_t, std::int64_t triangles, std::int64_t vertices,
                                     const UnwrapOptions& options) {
  return Caught([&] {
    v1::EstimateJobRequest request;
    request.mutable_size()->set_triangles(triangles);
    request.mutable_size()->set_vertices(vertices > 0 ? vertices : triangles / 2);
    return impl_->Estimate(std::move(request), options);
  });
}

Result<Capabilities> Client::GetCapabilities(std::nothrow_t) {
  return Caught([&] { return FromProto(impl_->rpc.Repeat(&Stub::GetCapabilities, v1::GetCapabilitiesRequest())); });
}

const char* Version() {
  return PLANISH_VERSION;
}

}  // namespace planish::inline abi0
