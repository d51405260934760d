// C++ client of a planish server. One header to include, std types only.
//
//   planish::PrivateServer server;                 // or a running one: planish::Client client("host:50051");
//   planish::Client client(server.target());
//   planish::UnwrapResult result = client.Unwrap({positions, triangles});
//   double u = result.uv[2 * (3 * f + k)];         // corner k of triangle f, in the caller's own order
//
// What a network and a server may do in between stays inside: a broken stream is taken up where it ended, a server that
// was restarted is waited for, a full queue too, and what is safe to repeat is repeated, at the pace the server asks
// for.
//
// Calls throw planish::Error. Unwrap throws for a job that failed as well, so a result in hand always has UV; look
// at UnwrapResult::IsUsable() and report.warnings for promises that were not kept.
//
// Each call has an overload that takes std::nothrow first and returns a Result, with the same error where the other one
// throws; Make() stands for a constructor. Programs that are built without exceptions call these alone:
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
  // A call gives up with SERVER_UNREACHABLE when no connection stands after this time. A refused connection fails
  // at once.
  Seconds connect_timeout{5};
  // How long calls about a job (Unwrap, AttachResult, WatchJob, CreateJob) wait for a server that was lost on the way,
  // from its last word on, before they throw CONNECTION_LOST. The wait between attempts of any call starts at
  // `backoff` and doubles up to 5 s, a little at random.
  Seconds reattach_timeout{60};
  Seconds backoff{0.1};
  // How long Unwrap and CreateJob go on asking a server whose queue or store is full, at the pace it asks for; 0: not
  // at all.
  Seconds queue_full_timeout{60};
  // How long the other calls wait for a server that was lost; 0: not at all.
  Seconds retry_timeout{10};
  // Meshes with more bytes than this, as sent, travel ahead by an upload that resumes where it broke; unset: as the
  // server advises.
  std::optional<std::int64_t> inline_mesh_bytes;

  // Encryption, of "host:port" only: Unix sockets need none. On as well if one of the files below is given.
  bool tls = false;
  // Who must have signed the server's certificate, PEM; empty: one of those that this system trusts.
  std::string tls_ca_file;
  // A certificate of the caller's own and its key, PEM, for servers that ask for one; both or none.
  std::string tls_cert_file, tls_key_file;
  // What the server's certificate must be for; empty: the host in `target`.
  std::string tls_server_name;

  // Says who calls. If `token` is empty it is the one in the file, without white space at its ends, which is read anew
  // for every call and so may change at any time.
  std::string token;
  std::string token_file;
  // A token that travels in the clear belongs to everybody on the way: without TLS it is sent within this machine only,
  // unless this allows more.
  bool token_over_plaintext = false;
};

// What a call may bring along.
struct CallOptions {
  // Help people and programs to find jobs again, e.g. {"file", "hero.obj"}. At most 32; keys of 1 to 63 characters of
  // a-z, 0-9, "-" and "_", the first one a letter; values of at most 256 bytes.
  std::map<std::string, std::string> labels;
  bool detached = false;   // the job survives the loss of its caller
  Seconds timeout{0};      // for the whole call; 0: none. An attached job is cancelled when it passes
  Scheduling scheduling;   // of the job, wherever its callers are
  std::string request_id;  // AIP-155; empty: a fresh UUID
  // W3C trace context that the call continues, as "00-<32 hex digits>-<16 hex digits>-01"; throws TRACEPARENT_INVALID.
  // Empty: the environment's TRACEPARENT if that is valid, else a new trace. The server's log lines carry its id.
  std::string traceparent;
  // For blocking calls: a request to stop cancels the job on the server (Unwrap) or ends the sending (CreateJob) or
  // watching (WatchJob, AttachResult), and the call throws CANCELLED.
  std::stop_token stop;
};

// One of several jobs that are queued together.
struct NewJob {
  MeshView mesh;
  UnwrapOptions options;
  CallOptions call;  // labels, scheduling and request_id
};

// Called one at a time: from within a blocking call on the calling thread, else on a thread of the library. They
// should return quickly. An exception ends the call (and cancels an attached job) and comes out of it.
struct Callbacks {
  // Bytes of the mesh sent so far, of how many, where it travels by an upload. Goes back to what arrived after a break.
  std::function<void(std::int64_t sent, std::int64_t total)> on_upload;
  // Every event in order, from sequence 1 (or after_sequence + 1) on. After the loss of both connection and job an
  // attached unwrap is submitted anew: events then start again at 1 under the name of the new job.
  std::function<void(const Event&)> on_event;
  // UV bytes so far, of how many.
  std::function<void(std::int64_t received, std::int64_t total)> on_download;
  // An attempt failed; another one follows after `wait`.
  std::function<void(const Error& why, Seconds wait)> on_reconnect;
  // Asynchronous calls only: exactly one of these comes, last.
  std::function<void(const UnwrapResult&)> on_done;
  std::function<void(const Error&)> on_error;
};

// An asynchronous unwrap. Movable. Its destructor cancels and waits, like std::jthread's; keep it while it runs.
// All functions are thread-safe except moving, Wait() and the destructor.
class Call {
 public:
  Call() = default;
  Call(Call&&) = default;
  Call& operator=(Call&&) = default;

  // Asks the server to cancel the job; returns at once. The call then ends with CANCELLED, or with its result if
  // that was quicker.
  void Cancel();
  // Asks the server to end the job soon with the best valid map so far (warning STOPPED); returns at once. The call
  // then ends with that result, or with STOPPED_EARLY if there was no valid map yet.
  void Stop();
  // Name of the job; empty until the server has accepted it.
  std::string job() const;
  // Whether the call ended, waiting so long for it.
  bool WaitFor(Seconds timeout) const;
  // Waits for the end; the result, or the error. Once only.
  Result<UnwrapResult> Wait(std::nothrow_t);
  UnwrapResult Wait() { return Wait(std::nothrow).value(); }

 private:
  friend class Client;
  struct State;
  explicit Call(std::shared_ptr<State> state) : state_(std::move(state)) {}
  std::shared_ptr<State> state_;
};

// A connection to one server, made by the first call and re-made when lost. Movable; all calls are thread-safe.
class Client {
 public:
  // `target`: "host:port" or "unix:/path". Throws INVALID_ARGUMENT (OPTIONS_INVALID) if options of TLS and token do not
  // fit together or with `target`, or one of their files cannot be used. All but the token's are read here, once.
  explicit Client(const std::string& target, const ClientOptions& options = {});
  static Result<Client> Make(const std::string& target, const ClientOptions& options = {});
  Client(Client&&) = default;
  Client& operator=(Client&&) = default;

  const std::string& target() const;

  // Flattens `mesh` and waits for the UV. Throws INVALID_ARGUMENT (MESH_*, OPTIONS_INVALID), RESOURCE_EXHAUSTED
  // (QUEUE_FULL, STORAGE_FULL, MEMORY_LIMIT, MESH_TOO_LARGE), ALREADY_EXISTS (REQUEST_ID_REUSED), and whatever the job
  // failed with.
  Result<UnwrapResult> Unwrap(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {},
                              const Callbacks& callbacks = {}, const CallOptions& call = {});
  UnwrapResult Unwrap(const MeshView& mesh, const UnwrapOptions& options = {}, const Callbacks& callbacks = {},
                      const CallOptions& call = {}) {
    return Unwrap(std::nothrow, mesh, options, callbacks, call).value();
  }

  // The same on a thread of the library. The mesh is encoded before this returns and need not outlive it; one that
  // cannot be encoded is an error of this call.
  Result<Call> StartUnwrap(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {},
                           Callbacks callbacks = {}, CallOptions call = {});
  Call StartUnwrap(const MeshView& mesh, const UnwrapOptions& options = {}, Callbacks callbacks = {},
                   CallOptions call = {}) {
    return StartUnwrap(std::nothrow, mesh, options, std::move(callbacks), std::move(call)).value();
  }

  // Queues a job and returns as soon as the server has it; AttachResult brings the UV.
  Result<Job> CreateJob(std::nothrow_t, const MeshView& mesh, const UnwrapOptions& options = {},
                        const CallOptions& call = {});
  Job CreateJob(const MeshView& mesh, const UnwrapOptions& options = {}, const CallOptions& call = {}) {
    return CreateJob(std::nothrow, mesh, options, call).value();
  }

  // Queues several jobs with few calls, and sends only meshes that the server does not have. What became of each, in
  // the order of `jobs`: a job without report, or what CreateJob would throw. One that is refused hurts no other. A
  // full queue is an error (QUEUE_FULL) of those that it has no room for; only large meshes, which travel by
  // themselves, wait for room as CreateJob does. Throws if the server cannot be asked: what it has accepted by then,
  // the same request ids bring again.
  Result<std::vector<Result<Job>>> CreateJobs(std::nothrow_t, std::span<const NewJob> jobs);
  std::vector<Result<Job>> CreateJobs(std::span<const NewJob> jobs) { return CreateJobs(std::nothrow, jobs).value(); }

  // Follows a job until it ended and brings its UV, checked against `mesh`, which must be the mesh it was created
  // with (MESH_MISMATCH otherwise). NOT_FOUND: JOB_NOT_FOUND, or RESULT_EXPIRED where the server kept the UV long
  // enough. Stopping does not touch the job.
  Result<UnwrapResult> AttachResult(std::nothrow_t, const std::string& job, const MeshView& mesh,
                                    const Callbacks& callbacks = {}, const CallOptions& call = {});
  UnwrapResult AttachResult(const std::string& job, const MeshView& mesh, const Callbacks& callbacks = {},
                            const CallOptions& call = {}) {
    return AttachResult(std::nothrow, job, mesh, callbacks, call).value();
  }

  // Follows a job until it ended, whatever the end. Events after `after_sequence` only.
  Result<Job> WatchJob(std::nothrow_t, const std::string& job, const Callbacks& callbacks = {},
                       std::int64_t after_sequence = 0, const CallOptions& call = {});
  Job WatchJob(const std::string& job, const Callbacks& callbacks = {}, std::int64_t after_sequence = 0,
               const CallOptions& call = {}) {
    return WatchJob(std::nothrow, job, callbacks, after_sequence, call).value();
  }

  // NOT_FOUND: no such job. `job` is a name, "jobs/...".
  Result<Job> GetJob(std::nothrow_t, const std::string& job);
  Job GetJob(const std::string& job) { return GetJob(std::nothrow, job).value(); }
  // The job when it has ended, or after this time (0: however long it takes) as it is then: like WatchJob, but by
  // calls that are over after some seconds each, for networks that cut streams.
  Result<Job> WaitJob(std::nothrow_t, const std::string& job, Seconds timeout = {});
  Job WaitJob(const std::string& job, Seconds timeout = {}) { return WaitJob(std::nothrow, job, timeout).value(); }
  // `size` bytes of the UV of a job that SUCCEEDED, from byte `offset` on, as planish.v1.UvDescription lays them out;
  // fewer where the UV end. FAILED_PRECONDITION: JOB_NOT_FINISHED, NO_RESULT; NOT_FOUND: RESULT_EXPIRED; OUT_OF_RANGE.
  Result<std::string> ReadResult(std::nothrow_t, const std::string& job, std::int64_t offset, std::int64_t size);
  std::string ReadResult(const std::string& job, std::int64_t offset, std::int64_t size) {
    return ReadResult(std::nothrow, job, offset, size).value();
  }
  // Newest first, at most `limit` (0: all), without reports. `filter` as in planish.v1.ListJobs, for instance
  // "state = RUNNING AND labels.file = \"night/*\""; empty: all.
  Result<std::vector<Job>> ListJobs(std::nothrow_t, int limit = 50, const std::string& filter = "");
  std::vector<Job> ListJobs(int limit = 50, const std::string& filter = "") {
    return ListJobs(std::nothrow, limit, filter).value();
  }
  // Asks a job to end soon with the best valid map so far (warning STOPPED). The job, QUEUED or STOPPING; one that
  // ended already is left as it is.
  Result<Job> StopJob(std::nothrow_t, const std::string& job);
  Job StopJob(const std::string& job) { return StopJob(std::nothrow, job).value(); }
  // The job, now CANCELLED or STOPPING; one that ended already is left as it is.
  Result<Job> CancelJob(std::nothrow_t, const std::string& job);
  Job CancelJob(const std::string& job) { return CancelJob(std::nothrow, job).value(); }
  // FAILED_PRECONDITION: the job has not ended.
  Result<void> DeleteJob(std::nothrow_t, const std::string& job);
  void DeleteJob(const std::string& job) { DeleteJob(std::nothrow, job).value(); }
  // What unwrapping would need and how long it would wait, without doing it: of a mesh (which is encoded but for its
  // first bytes not sent), or of one with so many triangles and vertices (0: half as many as triangles).
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
