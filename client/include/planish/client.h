// C++ client of a planish server. One header to include, std types only.
//
//   planish::PrivateServer server;                 // or a running one: planish::Client client("host:50051");
//   planish::Client client(server.target());
//   planish::UnwrapResult result = client.Unwrap({positions, triangles});
//   float u = result.uv.floats[2 * (3 * f + k)];   // corner k of triangle f, in the caller's own order
//
// Calls throw planish::Error. Unwrap throws for a job that failed as well, so a result in hand always has UV; look
// at UnwrapResult::IsUsable() and report.warnings for promises that were not kept.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "planish/error.h"
#include "planish/private_server.h"
#include "planish/types.h"

namespace planish {
inline namespace api {

struct ClientOptions {
  // A call gives up with SERVER_UNREACHABLE when no connection stands after this time. A refused connection fails
  // at once.
  double connect_timeout_seconds = 5;
  // After a broken stream: attempts in a row that bring nothing before CONNECTION_LOST. The wait between them starts
  // at reattach_backoff_seconds and doubles up to 5 s.
  int reattach_attempts = 8;
  double reattach_backoff_seconds = 0.1;
  // How long Unwrap and CreateJob go on asking a server whose queue is full, at the pace it asks for; 0: not at all.
  double queue_full_wait_seconds = 60;
};

// What a call may bring along.
struct CallOptions {
  std::string label;           // helps people to tell jobs apart, e.g. a file name; at most 256 bytes
  bool detached = false;       // the job survives the loss of its caller
  double timeout_seconds = 0;  // for the whole call; 0: none. An attached job is cancelled when it passes
  std::string request_id;      // AIP-155; empty: a fresh UUID
  // For blocking calls: a request to stop cancels the job on the server (Unwrap) or ends the watching (WatchJob,
  // AttachResult), and the call throws CANCELLED.
  std::stop_token stop;
};

// Called one at a time: from within a blocking call on the calling thread, else on a thread of the library. They
// should return quickly. An exception ends the call (and cancels an attached job) and comes out of it.
struct Callbacks {
  // Every event in order, from sequence 1 (or after_sequence + 1) on. After the loss of both connection and job an
  // attached unwrap is submitted anew: events then start again at 1 under the name of the new job.
  std::function<void(const Event&)> on_event;
  // UV bytes so far, of how many.
  std::function<void(std::int64_t received, std::int64_t total)> on_download;
  // The stream broke; another attempt follows after `wait_seconds`.
  std::function<void(const Error& why, double wait_seconds)> on_reconnect;
  // Asynchronous calls only: exactly one of these comes, last.
  std::function<void(const UnwrapResult&)> on_done;
  std::function<void(const Error&)> on_error;
};

// An asynchronous unwrap. Movable. Its destructor cancels and waits, like std::jthread's; keep it while it runs.
// All functions are thread-safe except moving, Wait() and the destructor.
class Call {
 public:
  Call();
  ~Call();
  Call(Call&&) noexcept;
  Call& operator=(Call&&) noexcept;

  // Asks the server to cancel the job; returns at once. The call then ends with CANCELLED, or with its result if
  // that was quicker.
  void Cancel();
  // Name of the job; empty until the server has accepted it.
  std::string job() const;
  // Whether the call ended, waiting up to so many seconds for it.
  bool WaitFor(double seconds) const;
  // Waits for the end; the result, or throws the error. Once only.
  UnwrapResult Wait();

 private:
  friend class Client;
  struct State;
  explicit Call(std::shared_ptr<State> state);
  void End();
  std::shared_ptr<State> state_;
};

// A connection to one server, made by the first call and re-made when lost. Movable; all calls are thread-safe.
class Client {
 public:
  // `target`: "host:port" or "unix:/path".
  explicit Client(const std::string& target, const ClientOptions& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  const std::string& target() const;

  // Flattens `mesh` and waits for the UV. If the stream breaks, the library re-attaches to the job.
  // Throws INVALID_ARGUMENT (MESH_*, OPTIONS_INVALID), RESOURCE_EXHAUSTED (QUEUE_FULL, MESH_TOO_LARGE), and
  // whatever the job failed with.
  UnwrapResult Unwrap(const MeshView& mesh, const UnwrapOptions& options = {}, const Callbacks& callbacks = {},
                      const CallOptions& call = {});

  // The same on a thread of the library. The mesh is encoded before this returns and need not outlive it.
  Call StartUnwrap(const MeshView& mesh, const UnwrapOptions& options = {}, Callbacks callbacks = {},
                   CallOptions call = {});

  // Queues a job and returns at once; AttachResult brings the UV.
  Job CreateJob(const MeshView& mesh, const UnwrapOptions& options = {}, const CallOptions& call = {});

  // Follows a job until it ended and brings its UV, checked against `mesh`, which must be the mesh it was created
  // with (MESH_MISMATCH otherwise). Stopping does not touch the job.
  UnwrapResult AttachResult(const std::string& job, const MeshView& mesh, const Callbacks& callbacks = {},
                            const CallOptions& call = {});

  // Follows a job until it ended, whatever the end. Events after `after_sequence` only.
  Job WatchJob(const std::string& job, const Callbacks& callbacks = {}, std::int64_t after_sequence = 0,
               const CallOptions& call = {});

  // NOT_FOUND: no such job. `job` is a name, "jobs/...".
  Job GetJob(const std::string& job);
  // Newest first, at most `limit` (0: all), only those in `state` if given. Without report and progress.
  std::vector<Job> ListJobs(int limit = 50, std::optional<JobState> state = {});
  // The job, now CANCELLED or STOPPING; one that ended already is left as it is.
  Job CancelJob(const std::string& job);
  // FAILED_PRECONDITION: the job has not ended.
  void DeleteJob(const std::string& job);
  Capabilities GetCapabilities();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

// Version of this library, "0.1.0".
const char* Version();

}  // namespace api
}  // namespace planish
