#include "planish/client.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "client/src/backoff.h"
#include "client/src/convert.h"
#include "client/src/errors.h"
#include "client/src/follower.h"
#include "client/src/mesh_packer.h"
#include "client/src/mesh_sender.h"
#include "client/src/request_id.h"
#include "client/src/rpc.h"
#include "client/src/stream_errors.h"
#include "client/src/trace_scope.h"
#include "client/src/uv_bytes.h"
#include "core/base/trace_context.h"

namespace planish {
inline namespace abi0 {
namespace {

using Clock = std::chrono::steady_clock;

// Of a Draco file, for EstimateJob: what declares its size.
constexpr std::size_t kEstimateBytes = 1024;

// Of one BatchCreateJobs: jobs, and bytes of their meshes; a larger mesh travels by itself, by an upload that resumes.
constexpr std::size_t kMostInBatch = 100;
constexpr std::size_t kMostBatchBytes = std::size_t{1} << 20;

// Of one WaitJob, which a proxy must not take for a dead connection.
constexpr double kLongestWaitSeconds = 15;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Why a job that ended without UV did so.
Error ErrorOf(const v1::Job& job, const PackedMesh& mesh) {
  if (job.state() == v1::JOB_STATE_FAILED && job.has_error()) {
    return Renumbered(ErrorFrom(job.error()), mesh.ToCaller()).set_job(job.name());
  }
  if (job.state() == v1::JOB_STATE_CANCELLED) {
    return Error(ErrorCode::kCancelled, "CANCELLED", "the job was cancelled").set_job(job.name());
  }
  return Error(ErrorCode::kInternal, "INTERNAL",
               "the job ended as " + v1::JobState_Name(job.state()) + " without a word")
      .set_job(job.name());
}

// Everything but the mesh itself.
template <typename Request>
Request NewJobRequest(const PackedMesh& mesh, const UnwrapOptions& options, const CallOptions& call) {
  Request request;
  v1::JobSpec& spec = *request.mutable_spec();
  spec.mutable_seam_corners()->Add(mesh.seam_corners.begin(), mesh.seam_corners.end());
  spec.mutable_uncut_corners()->Add(mesh.uncut_corners.begin(), mesh.uncut_corners.end());
  *spec.mutable_options() = ToProto(options);
  *spec.mutable_scheduling() = ToProto(call.scheduling);
  spec.mutable_labels()->insert(call.labels.begin(), call.labels.end());
  request.set_request_id(call.request_id.empty() ? NewRequestId() : call.request_id);
  return request;
}

UnwrapResult ResultOf(const Followed& followed, const PackedMesh& mesh) {
  if (followed.job.state() != v1::JOB_STATE_SUCCEEDED) throw ErrorOf(followed.job, mesh);
  UnwrapResult result;
  result.job = followed.job.name();
  try {
    result.uv = ParseUv(followed.job.uv(), followed.uv_bytes, mesh);
  } catch (Error& error) {
    throw error.set_job(result.job);
  }
  result.report = FromProto(followed.job.report(), mesh.ToCaller());
  return result;
}

// Runs `work` with `*call` as part of one trace, which an error names.
template <typename Work>
auto Traced(CallOptions* call, Work work) {
  const TraceScope trace(call->traceparent);
  call->traceparent = trace.traceparent();
  try {
    return work(trace);
  } catch (Error& error) {
    error.set_trace_id(trace.trace_id());
    throw;
  }
}

}  // namespace

class Client::Impl : public std::enable_shared_from_this<Client::Impl> {
 public:
  Impl(const std::string& target, const ClientOptions& options)
      : options_(options), rpc_(std::make_shared<Rpc>(target, options)) {}

  Rpc& rpc() { return *rpc_; }

  // `start` is when the caller called, before the mesh was packed.
  UnwrapResult Unwrap(PackedMesh mesh, Clock::time_point start, const UnwrapOptions& options,
                      const Callbacks& callbacks, CallOptions call, std::function<void(const std::string&)> on_job_name,
                      std::stop_token finish = {}) {
    return Traced(&call, [&](const TraceScope& trace) {
      UnwrapResult result =
          UnwrapInTrace(std::move(mesh), start, options, callbacks, call, std::move(on_job_name), std::move(finish));
      result.trace_id = trace.trace_id();
      return result;
    });
  }

  Followed Watch(const std::string& job, PackedMesh* mesh, std::int64_t after_sequence, const Callbacks& callbacks,
                 CallOptions call) {
    return Traced(&call, [&](const TraceScope&) { return WatchInTrace(job, mesh, after_sequence, callbacks, call); });
  }

  // Sends the mesh and creates the job, again and again while the server's queue is full or the server is lost, and
  // patience lasts: the request id makes that safe.
  v1::Job Create(PackedMesh mesh, const UnwrapOptions& options, CallOptions call) {
    return Traced(&call, [&](const TraceScope&) { return CreateInTrace(std::move(mesh), options, call); });
  }

  std::vector<CreatedJob> CreateMany(std::span<const NewJob> jobs) {
    CallOptions call;
    return Traced(&call, [&](const TraceScope&) { return CreateManyInTrace(jobs); });
  }

 private:
  UnwrapResult UnwrapInTrace(PackedMesh mesh, Clock::time_point start, const UnwrapOptions& options,
                             const Callbacks& callbacks, const CallOptions& call,
                             std::function<void(const std::string&)> on_job_name, std::stop_token finish) {
    const double packing_seconds = SecondsSince(start);
    FollowPlan plan;
    plan.unwrap = NewJobRequest<v1::UnwrapRequest>(mesh, options, call);
    plan.unwrap->set_detached(call.detached);
    plan.mesh = &mesh;
    plan.call = call;
    plan.finish = std::move(finish);
    plan.on_job_name = std::move(on_job_name);
    const Followed followed = Follower(rpc_, options_, std::move(plan), callbacks).Run();
    UnwrapResult result = ResultOf(followed, mesh);
    result.report.seconds.upload = packing_seconds + followed.upload_seconds;
    result.report.seconds.download = followed.download_seconds;
    result.report.seconds.total = SecondsSince(start);
    return result;
  }

  Followed WatchInTrace(const std::string& job, PackedMesh* mesh, std::int64_t after_sequence,
                        const Callbacks& callbacks, const CallOptions& call) {
    FollowPlan plan;
    plan.watch.emplace();
    plan.watch->set_name(job);
    plan.watch->set_after_sequence(after_sequence);
    plan.watch->set_include_uv(mesh != nullptr);
    plan.mesh = mesh;
    plan.call = call;
    return Follower(rpc_, options_, std::move(plan), callbacks).Run();
  }

  v1::Job CreateInTrace(PackedMesh mesh, const UnwrapOptions& options, const CallOptions& call) {
    const Deadline deadline = DeadlineAfter(call.timeout_seconds);
    const Callbacks no_callbacks;
    auto request = NewJobRequest<v1::CreateJobRequest>(mesh, options, call);
    MeshSender sender(rpc_, options_, &mesh, call, no_callbacks, deadline);
    Backoff backoff(options_.reattach_backoff_seconds, kLongestPauseSeconds, request.request_id());
    double waited_for_room = 0, waited_for_server = 0;
    while (true) {
      try {
        sender.Send(*request.mutable_spec());
        return rpc_->CreateJob(request, deadline);
      } catch (const Error& error) {
        if (sender.ForgetUpload(error, *request.mutable_spec())) continue;
        const bool is_full = AsksToWait(error);
        if (!is_full && (!IsBrokenStream(error) || !rpc_->reached() || error.reason() == "DRAINING")) throw;
        const double pause = std::max(is_full ? 0.05 : backoff.Next(), error.retry_after_seconds());
        double& waited = is_full ? waited_for_room : waited_for_server;
        waited += pause;
        if (waited > (is_full ? options_.queue_full_wait_seconds : options_.reattach_seconds)) throw;
        ThrowIfLate(deadline, pause, error);
        std::this_thread::sleep_for(std::chrono::duration<double>(pause));
      }
    }
  }

  // One of the jobs of CreateMany() on its way.
  struct Pending {
    PackedMesh mesh;
    std::size_t index = 0;  // among the jobs
    bool is_known = false;  // the server has the mesh
  };

  std::vector<CreatedJob> CreateManyInTrace(std::span<const NewJob> jobs) {
    std::vector<CreatedJob> created(jobs.size());
    for (std::size_t begin = 0; begin < jobs.size();) {
      // So many meshes as fit into a call are in memory at a time.
      std::vector<Pending> batch;
      std::size_t bytes = 0;
      for (; begin < jobs.size() && batch.size() < kMostInBatch && bytes < kMostBatchBytes; ++begin) {
        try {
          batch.push_back({MeshPacker::Pack(jobs[begin].mesh), begin, false});
          bytes += batch.back().mesh.draco.size();
        } catch (const Error& error) {
          created[begin].error = error;
        }
      }
      if (!batch.empty()) CreateBatch(jobs, std::move(batch), &created);
    }
    return created;
  }

  void CreateBatch(std::span<const NewJob> jobs, std::vector<Pending> batch, std::vector<CreatedJob>* created) {
    v1::FindMissingMeshesRequest digests;
    for (const Pending& each : batch) digests.add_sha256(each.mesh.sha256);
    const v1::FindMissingMeshesResponse answer = rpc_->FindMissingMeshes(digests);
    const std::set<std::string> missing(answer.missing_sha256().begin(), answer.missing_sha256().end());
    std::vector<Pending> together, alone;
    for (Pending& each : batch) {
      each.is_known = !missing.contains(each.mesh.sha256);
      const bool is_large = !each.is_known && each.mesh.draco.size() > kMostBatchBytes;
      (is_large ? alone : together).push_back(std::move(each));
    }
    v1::BatchCreateJobsRequest request;
    for (Pending& each : together) {
      const NewJob& job = jobs[each.index];
      *request.add_requests() = NewJobRequest<v1::CreateJobRequest>(each.mesh, job.options, job.call);
      v1::JobSpec& spec = *request.mutable_requests()->rbegin()->mutable_spec();
      if (each.is_known) {
        spec.set_mesh_sha256(each.mesh.sha256);
      } else {
        spec.set_draco(std::move(each.mesh.draco));
      }
    }
    if (!together.empty()) {
      const v1::BatchCreateJobsResponse response = rpc_->BatchCreateJobs(request);
      for (std::size_t i = 0; i < together.size(); ++i) {
        Pending& each = together[i];
        if (static_cast<int>(i) >= response.results_size()) {
          throw Error(ErrorCode::kInternal, "INTERNAL", "the server answered to fewer jobs than it was asked for");
        }
        const auto& result = response.results(static_cast<int>(i));
        CreatedJob& end = (*created)[each.index];
        if (result.has_job()) {
          end.job = FromProto(result.job());
          continue;
        }
        end.error = Renumbered(ErrorFrom(result.error()), each.mesh.ToCaller());
        if (each.is_known && end.error->reason() == "MESH_NOT_FOUND") alone.push_back(std::move(each));
      }
    }
    for (Pending& each : alone) {
      const NewJob& job = jobs[each.index];
      CreatedJob& end = (*created)[each.index];
      end = CreatedJob();
      try {
        end.job = FromProto(CreateInTrace(std::move(each.mesh), job.options, job.call));
      } catch (const Error& error) {
        end.error = error;
      }
    }
  }

  const ClientOptions options_;
  const std::shared_ptr<Rpc> rpc_;
};

struct Call::State {
  std::stop_source stop;    // cancels
  std::stop_source finish;  // stops
  std::thread thread;

  mutable std::mutex mutex;
  mutable std::condition_variable changed;
  bool done = false;
  std::string job;
  std::optional<UnwrapResult> result;
  std::exception_ptr error;

  void Finish(std::optional<UnwrapResult> r, std::exception_ptr e) {
    const std::lock_guard lock(mutex);
    result = std::move(r);
    error = std::move(e);
    done = true;
    changed.notify_all();
  }
};

Call::Call() = default;
Call::Call(std::shared_ptr<State> state) : state_(std::move(state)) {}
Call::Call(Call&&) noexcept = default;
Call& Call::operator=(Call&& other) noexcept {
  if (this != &other) {
    End();
    state_ = std::move(other.state_);
  }
  return *this;
}
Call::~Call() {
  End();
}

void Call::End() {
  if (state_ == nullptr || !state_->thread.joinable()) return;
  state_->stop.request_stop();
  if (state_->thread.get_id() == std::this_thread::get_id()) {
    state_->thread.detach();  // ended from within its own callback; the thread keeps its state
  } else {
    state_->thread.join();
  }
}

void Call::Cancel() {
  if (state_ != nullptr) state_->stop.request_stop();
}

void Call::Stop() {
  if (state_ != nullptr) state_->finish.request_stop();
}

std::string Call::job() const {
  if (state_ == nullptr) return {};
  const std::lock_guard lock(state_->mutex);
  return state_->job;
}

bool Call::WaitFor(double seconds) const {
  if (state_ == nullptr) return true;
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return state_->done; });
}

UnwrapResult Call::Wait() {
  if (state_ == nullptr) throw Error(ErrorCode::kFailedPrecondition, "CALL_EMPTY", "this call was never started");
  std::unique_lock lock(state_->mutex);
  state_->changed.wait(lock, [&] { return state_->done; });
  if (state_->error) std::rethrow_exception(state_->error);
  return *std::move(state_->result);
}

Client::Client(const std::string& target, const ClientOptions& options)
    : impl_(std::make_shared<Impl>(target, options)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

const std::string& Client::target() const {
  return impl_->rpc().target();
}

UnwrapResult Client::Unwrap(const MeshView& mesh, const UnwrapOptions& options, const Callbacks& callbacks,
                            const CallOptions& call) {
  const Clock::time_point start = Clock::now();
  return impl_->Unwrap(MeshPacker::Pack(mesh), start, options, callbacks, call, {});
}

Call Client::StartUnwrap(const MeshView& mesh, const UnwrapOptions& options, Callbacks callbacks, CallOptions call) {
  const Clock::time_point start = Clock::now();
  auto state = std::make_shared<Call::State>();
  // A token of the caller's works as well as Call::Cancel().
  auto callers_stop =
      std::make_shared<std::stop_callback<std::function<void()>>>(call.stop, [weak = std::weak_ptr(state)] {
        if (const auto locked = weak.lock()) locked->stop.request_stop();
      });
  call.stop = state->stop.get_token();
  state->thread = std::thread([impl = impl_, state, callers_stop, start, packed = MeshPacker::Pack(mesh), options,
                               callbacks = std::move(callbacks), call = std::move(call)]() mutable {
    const auto on_job_name = [&](const std::string& name) {
      const std::lock_guard lock(state->mutex);
      state->job = name;
    };
    std::optional<UnwrapResult> result;
    std::exception_ptr failure;
    try {
      result = impl->Unwrap(std::move(packed), start, options, callbacks, call, on_job_name, state->finish.get_token());
      if (callbacks.on_done) callbacks.on_done(*result);
    } catch (const Error& error) {
      failure = std::current_exception();
      if (callbacks.on_error) callbacks.on_error(error);
    } catch (const std::exception& exception) {
      failure = std::current_exception();
      if (callbacks.on_error) callbacks.on_error(Error(ErrorCode::kUnknown, "CALLBACK_FAILED", exception.what()));
    }
    state->Finish(std::move(result), failure);
  });
  return Call(state);
}

Job Client::CreateJob(const MeshView& mesh, const UnwrapOptions& options, const CallOptions& call) {
  return FromProto(impl_->Create(MeshPacker::Pack(mesh), options, call));
}

std::vector<CreatedJob> Client::CreateJobs(std::span<const NewJob> jobs) {
  return impl_->CreateMany(jobs);
}

UnwrapResult Client::AttachResult(const std::string& job, const MeshView& mesh, const Callbacks& callbacks,
                                  const CallOptions& call) {
  const Clock::time_point start = Clock::now();
  PackedMesh packed = MeshPacker::Pack(mesh);
  const Followed followed = impl_->Watch(job, &packed, 0, callbacks, call);
  UnwrapResult result = ResultOf(followed, packed);
  result.report.seconds.download = followed.download_seconds;
  result.report.seconds.total = SecondsSince(start);
  result.trace_id = std::string(TraceIdOf(followed.job.traceparent()));
  return result;
}

Job Client::WatchJob(const std::string& job, const Callbacks& callbacks, std::int64_t after_sequence,
                     const CallOptions& call) {
  const Followed followed = impl_->Watch(job, nullptr, after_sequence, callbacks, call);
  return FromProto(followed.job);
}

Job Client::GetJob(const std::string& job) {
  return FromProto(impl_->rpc().GetJob(job));
}

Job Client::WaitJob(const std::string& job, double timeout_seconds) {
  const auto start = Clock::now();
  while (true) {
    const double left = timeout_seconds <= 0 ? kLongestWaitSeconds : timeout_seconds - SecondsSince(start);
    const v1::Job now = impl_->rpc().WaitJob(job, std::clamp(left, 0.0, kLongestWaitSeconds));
    Job waited = FromProto(now);
    if (IsTerminal(waited.state) || (timeout_seconds > 0 && SecondsSince(start) >= timeout_seconds)) return waited;
  }
}

std::string Client::ReadResult(const std::string& job, std::int64_t offset, std::int64_t size) {
  std::string bytes;
  while (static_cast<std::int64_t>(bytes.size()) < size) {
    const auto have = static_cast<std::int64_t>(bytes.size());
    const v1::ReadResultResponse piece = impl_->rpc().ReadResult(job, offset + have, size - have);
    if (piece.data().empty()) break;
    bytes += piece.data();
  }
  return bytes;
}

std::vector<Job> Client::ListJobs(int limit, const std::string& filter) {
  constexpr int kPageSize = 1000;
  std::vector<Job> jobs;
  v1::ListJobsRequest request;
  request.set_filter(filter);
  do {
    const int left = limit > 0 ? limit - static_cast<int>(jobs.size()) : kPageSize;
    request.set_page_size(std::min(left, kPageSize));
    const v1::ListJobsResponse response = impl_->rpc().ListJobs(request);
    for (const v1::Job& job : response.jobs()) jobs.push_back(FromProto(job));
    // The next page is of the same server: a page token means nothing to others.
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty() && (limit <= 0 || static_cast<int>(jobs.size()) < limit));
  return jobs;
}

Job Client::StopJob(const std::string& job) {
  return FromProto(impl_->rpc().StopJob(job));
}

Job Client::CancelJob(const std::string& job) {
  return FromProto(impl_->rpc().CancelJob(job));
}

void Client::DeleteJob(const std::string& job) {
  impl_->rpc().DeleteJob(job);
}

JobEstimate Client::Estimate(const MeshView& mesh, const UnwrapOptions& options) {
  const PackedMesh packed = MeshPacker::Pack(mesh);
  v1::EstimateJobRequest request;
  request.mutable_spec()->set_draco(packed.draco.substr(0, kEstimateBytes));
  request.set_mesh_bytes(static_cast<std::int64_t>(packed.draco.size()));
  *request.mutable_spec()->mutable_options() = ToProto(options);
  return FromProto(impl_->rpc().EstimateJob(request));
}

JobEstimate Client::Estimate(std::int64_t triangles, std::int64_t vertices, const UnwrapOptions& options) {
  v1::EstimateJobRequest request;
  request.mutable_size()->set_triangles(triangles);
  request.mutable_size()->set_vertices(vertices > 0 ? vertices : triangles / 2);
  *request.mutable_spec()->mutable_options() = ToProto(options);
  return FromProto(impl_->rpc().EstimateJob(request));
}

Capabilities Client::GetCapabilities() {
  return FromProto(impl_->rpc().GetCapabilities());
}

const char* Version() {
  return PLANISH_VERSION;
}

}  // namespace abi0
}  // namespace planish
