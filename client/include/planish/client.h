// C++ client of a planish server. One header to include, std types only.
//
//   planish::PrivateServer server;                 // or a running one: planish::Client client("host:50051");
//   planish::Client client(server.target());
//   planish::UnwrapResult result = client.Unwrap({positions, triangles});
//   double u = result.uv[2 * (3 * f + k)];         // corner k of triangle f, in the caller's own order
//
// The client handles failures of network and server: it resumes broken streams, waits while a server restarts or its
// queue is full, and retries calls that are safe to repeat, at the pace the server asks for.
//
// Calls throw planish::Error. Unwrap also throws if the job fails, so a result always has UV. UnwrapResult::IsUsable()
// and report.warnings say which promises were not kept.
//
// Each call has an overload with std::nothrow as first argument, which returns a Result with the error instead of
// throwing it; Make() replaces constructors. Programs built without exceptions use only these:
//
//   planish::Result<planish::UnwrapResult> result = client.Unwrap(std::nothrow, {positions, triangles});
//   if (!result) return Report(result.error());
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "planish/error.h"
#include "planish/private_server.h"
#include "planish/types.h"

namespace planish::inline abi0 {

struct ClientOptions {
  // A call fails with SERVER_UNREACHABLE if it has no connection after this time. A refused connection fails at once.
  Seconds connect_timeout{5};
  // How long calls about a job (Unwrap, AttachResult, WatchJob, CreateJob) wait for a lost server before they throw
  // CONNECTION_LOST, counted from the first error after the server's last message. The delay between attempts of any
  // call starts at `backoff` and doubles up to 5 s, with jitter.
  Seconds reattach_timeout{60};
  Seconds backoff{0.1};
  // How long Unwrap and CreateJob retry while the server's queue or store is full, at the pace that the server asks
  // for; 0: no retries.
  Seconds queue_full_timeout{60};
  // How long other calls wait for a lost server; 0: no retries.
  Seconds retry_timeout{10};
  // Meshes with more encoded bytes than this are sent by a resumable upload before the call; unset: the server's
  // advice.
  std::optional<std::int64_t> inline_mesh_bytes;

  // TLS, for "host:port" only: Unix sockets need none. Also on if one of the files below is given.
  bool tls = false;
  // The certificate authorities that may have signed the server's certificate, PEM; empty: those that this system
  // trusts.
  std::string tls_ca_file;
  // The client certificate and its private key, PEM, for servers that require them; both or none.
  std::string tls_cert_file, tls_key_file;
  // The name that the server's certificate must have; empty: the host in `target`.
  std::string tls_server_name;

  // The token identifies the caller. If `token` is empty, it is read from `token_file`, without surrounding white
  // space. The file is read again for every call, so it may change at any time.
  std::string token;
  std::string token_file;
  // Whether the token may be sent to other machines without TLS, although anybody on the way can read it then. Within
  // this machine it is always sent.
  bool token_over_plaintext = false;
};

// Options of one call.
struct CallOptions {
  // Labels by which the job can be found later, e.g. {"file", "hero.obj"}. At most 32; keys of 1 to 63 characters of
  // a-z, 0-9, "-" and "_", beginning with a letter; values of at most 256 bytes.
  std::map<std::string, std::string> labels;
  bool detached = false;   // the job continues if its caller disconnects
  Seconds timeout{0};      // for the whole call; 0: none. When it passes, an attached job is cancelled
  Scheduling scheduling;   // of the job, whether its callers are connected or not
  std::string request_id;  // a second call with the same id gets the same job (AIP-155); empty: a new UUID
  // W3C trace context of the call, as "00-<32 hex digits>-<16 hex digits>-01". Empty: the environment's TRACEPARENT if
  // it is valid, else a new trace. The server's log lines have the id of the trace. The call throws TRACEPARENT_INVALID
  // if this is not valid.
  std::string traceparent;
  // For blocking calls. A stop request makes the call throw CANCELLED: Unwrap cancels the job on the server, CreateJob
  // stops sending, WatchJob and AttachResult stop watching.
  std::stop_token stop;
};

// A job for CreateJobs().
struct NewJob {
  MeshView mesh;
  UnwrapOptions options;
  CallOptions call;  // only labels, scheduling and request_id are used
};

// Callbacks run one at a time: in a blocking call on the calling thread, otherwise on a thread of the library. They
// should return quickly. If a callback throws, the call ends (and cancels an attached job) and rethrows the exception.
struct Callbacks {
  // Called if the mesh is sent by an upload: bytes sent so far, and in total. After a lost connection, `sent` falls
  // back to the bytes that arrived.
  std::function<void(std::int64_t sent, std::int64_t total)> on_upload;
  // Called for every event in order, from sequence 1 (or after_sequence + 1) on. If both connection and job are lost,
  // an attached unwrap is submitted again: events then start again at 1 under the name of the new job.
  std::function<void(const Event&)> on_event;
  // Called while the result arrives: UV bytes received so far, and in total.
  std::function<void(std::int64_t received, std::int64_t total)> on_download;
  // Called when an attempt failed; the next one follows after `wait`.
  std::function<void(const Error& why, Seconds wait)> on_reconnect;
  // Asynchronous calls only: exactly one of these is called, last.
  std::function<void(const UnwrapResult&)> on_done;
  std::function<void(const Error&)> on_error;
};

// An asynchronous unwrap. Movable. Its destructor cancels the call and waits for its end, like std::jthread's, so keep
// the object. All functions are thread-safe except moving, Wait() and the destructor.
class Call {
 public:
  Call() = default;
  Call(Call&&) = default;
  Call& operator=(Call&&) = default;

  // Asks the server to cancel the job; returns at once. The call then ends with CANCELLED, or with its result if the
  // job finished before.
  void Cancel();
  // Asks the server to end the job soon with the best valid map so far (warning STOPPED); returns at once. The call
  // then ends with that result, or with STOPPED_EARLY if there was no valid map yet.
  void Stop();
  // Name of the job; empty until the server has accepted it.
  std::string job() const;
  // Waits at most for `timeout`; returns whether the call has ended.
  bool WaitFor(Seconds timeout) const;
  // Waits for the end; returns the result, or the error. Call at most once.
  Result<UnwrapResult> Wait(std::nothrow_t);
  UnwrapResult Wait() { return Wait(std::nothrow).value(); }

 private:
  friend class Client;
  struct State;
  explicit Call(std::shared_ptr<State> state) : state_(std::move(state)) {}
  std::shared_ptr<State> state_;
};

// A connection to one server, made by the first call and re-established when lost. Movable; all calls are thread-safe.
class Client {
 public:
  // `target`: "host:port" or "unix:/path". Throws INVALID_ARGUMENT (OPTIONS_INVALID) if the options about TLS and the
  // token contradict each other or `target`, or if one of their files cannot be used. The files are read only here,
  // except for the token's.
  explicit Client(const std::string& target, const ClientOptions& options = {});
  static Result<Client> Make(const std::string& target, const ClientOptions& options = {});
  Client(Client&&) = default;
  Client& operator=(Client&&) = default;

  const std::string& target() const;

  // Flattens `mesh` and waits for the UV. Throws INVALID_ARGUMENT (MESH_*, OPTIONS_INVALID), RESOURCE_EXHAUSTED
  // (QUEUE_FULL, STORAGE_FULL, MEMORY_LIMIT, MESH_TOO_LARGE), ALREADY_EXISTS (REQUEST_ID_REUSED), and the error of a
  // failed job.
  Result<UnwrapResult> Unwrap(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {},
                              const Callbacks& callbacks = {}, const CallOptions& call = {});
  UnwrapResult Unwrap(const MeshView& mesh, const UnwrapOptions& options = {}, const Callbacks& callbacks = {},
                      const CallOptions& call = {}) {
    return Unwrap(std::nothrow, mesh, options, callbacks, call).value();
  }

  // Like Unwrap(), but on a thread of the library. The mesh is encoded before StartUnwrap() returns and need not
  // outlive that; if it cannot be encoded, StartUnwrap() fails.
  Result<Call> StartUnwrap(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {},
                           Callbacks callbacks = {}, CallOptions call = {});
  Call StartUnwrap(const MeshView& mesh, const UnwrapOptions& options = {}, Callbacks callbacks = {},
                   CallOptions call = {}) {
    return StartUnwrap(std::nothrow, mesh, options, std::move(callbacks), std::move(call)).value();
  }

  // Queues a job and returns once the server has accepted it; AttachResult fetches the UV.
  Result<Job> CreateJob(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {},
                        const CallOptions& call = {});
  Job CreateJob(const MeshView& mesh, const UnwrapOptions& options = {}, const CallOptions& call = {}) {
    return CreateJob(std::nothrow, mesh, options, call).value();
  }

  // Queues several jobs with few calls, and sends only meshes that the server does not have. Returns for each job, in
  // the order of `jobs`, the job without report or the error that CreateJob would throw. A refused job does not affect
  // the others. Jobs for which the queue has no room fail with QUEUE_FULL; only large meshes, which are sent one by
  // one, wait for room as CreateJob does. Throws if the server cannot be reached. Then repeat the call with the same
  // request ids: jobs that were accepted before are not created twice.
  Result<std::vector<Result<Job>>> CreateJobs(std::nothrow_t, std::span<const NewJob> jobs);
  std::vector<Result<Job>> CreateJobs(std::span<const NewJob> jobs) { return CreateJobs(std::nothrow, jobs).value(); }

  // Follows a job until it ends, and fetches its UV. `mesh` must be the mesh that the job was created with
  // (MESH_MISMATCH otherwise). Throws NOT_FOUND: JOB_NOT_FOUND, or RESULT_EXPIRED if the retention time of the UV has
  // passed. A stop request does not affect the job.
  Result<UnwrapResult> AttachResult(std::nothrow_t, const std::string& job, const MeshView& mesh,
                                    const Callbacks& callbacks = {}, const CallOptions& call = {});
  UnwrapResult AttachResult(const std::string& job, const MeshView& mesh, const Callbacks& callbacks = {},
                            const CallOptions& call = {}) {
    return AttachResult(std::nothrow, job, mesh, callbacks, call).value();
  }

  // Follows a job until it ends, in any state, and returns it. Callbacks get only events after `after_sequence`.
  Result<Job> WatchJob(std::nothrow_t, const std::string& job, const Callbacks& callbacks = {},
                       std::int64_t after_sequence = 0, const CallOptions& call = {});
  Job WatchJob(const std::string& job, const Callbacks& callbacks = {}, std::int64_t after_sequence = 0,
               const CallOptions& call = {}) {
    return WatchJob(std::nothrow, job, callbacks, after_sequence, call).value();
  }

  // Returns the present state of a job. `job` is a name, "jobs/...". Throws NOT_FOUND if there is no such job.
  Result<Job> GetJob(std::nothrow_t, const std::string& job);
  Job GetJob(const std::string& job) { return GetJob(std::nothrow, job).value(); }
  // Waits until the job has ended, or for `timeout` (0: no limit), and returns the job. Unlike WatchJob it makes calls
  // of some seconds each, for networks that cut streams.
  Result<Job> WaitJob(std::nothrow_t, const std::string& job, Seconds timeout = {});
  Job WaitJob(const std::string& job, Seconds timeout = {}) { return WaitJob(std::nothrow, job, timeout).value(); }
  // Returns `size` bytes of the UV of a job that SUCCEEDED, from byte `offset` on, in the layout of
  // planish.v1.UvDescription; fewer at the end of the UV. Throws FAILED_PRECONDITION (JOB_NOT_FINISHED, NO_RESULT),
  // NOT_FOUND (RESULT_EXPIRED), and OUT_OF_RANGE if `offset` is beyond the UV.
  Result<std::string> ReadResult(std::nothrow_t, const std::string& job, std::int64_t offset, std::int64_t size);
  std::string ReadResult(const std::string& job, std::int64_t offset, std::int64_t size) {
    return ReadResult(std::nothrow, job, offset, size).value();
  }
  // Returns jobs, newest first, at most `limit` (0: all), without reports. `filter` is that of planish.v1.ListJobs, for
  // instance "state = RUNNING AND labels.file = \"night/*\""; empty: all jobs.
  Result<std::vector<Job>> ListJobs(std::nothrow_t, int limit = 50, const std::string& filter = "");
  std::vector<Job> ListJobs(int limit = 50, const std::string& filter = "") {
    return ListJobs(std::nothrow, limit, filter).value();
  }
  // Asks a job to end soon with the best valid map so far (warning STOPPED). Returns the job, QUEUED or STOPPING. No
  // effect on a job that has ended.
  Result<Job> StopJob(std::nothrow_t, const std::string& job);
  Job StopJob(const std::string& job) { return StopJob(std::nothrow, job).value(); }
  // Ends a job and discards its result. Returns the job, CANCELLED or STOPPING. No effect on a job that has ended.
  Result<Job> CancelJob(std::nothrow_t, const std::string& job);
  Job CancelJob(const std::string& job) { return CancelJob(std::nothrow, job).value(); }
  // Deletes a job and its UV. Throws FAILED_PRECONDITION if the job has not ended.
  Result<void> DeleteJob(std::nothrow_t, const std::string& job);
  void DeleteJob(const std::string& job) { DeleteJob(std::nothrow, job).value(); }
  // Estimates the memory, run time and waiting time of an unwrap without doing it: for a mesh (which is encoded, but
  // only its first bytes are sent), or for a number of triangles and vertices (0 vertices: half as many as triangles).
  Result<JobEstimate> Estimate(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {});
  JobEstimate Estimate(const MeshView& mesh, const UnwrapOptions& options = {}) {
    return Estimate(std::nothrow, mesh, options).value();
  }
  Result<JobEstimate> Estimate(std::nothrow_t, std::int64_t triangles, std::int64_t vertices = 0,
                               const UnwrapOptions& options = {});
  JobEstimate Estimate(std::int64_t triangles, std::int64_t vertices = 0, const UnwrapOptions& options = {}) {
    return Estimate(std::nothrow, triangles, vertices, options).value();
  }
  Result<Capabilities> GetCapabilities(std::nothrow_t);
  Capabilities GetCapabilities() { return GetCapabilities(std::nothrow).value(); }

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

// Version of this library, "0.1.0".
const char* Version();

}  // namespace planish::inline abi0
