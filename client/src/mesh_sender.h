// How a mesh gets to the server: inside the request that needs it or, where it is large, ahead of it in pieces.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "client/src/backoff.h"
#include "client/src/mesh_packer.h"
#include "client/src/rpc.h"

namespace planish {
inline namespace abi0 {

// Not thread-safe, except that a stop may come from anywhere.
class MeshSender {
 public:
  // `mesh` and `callbacks` must outlive the sender; the deadline is that of the whole call.
  MeshSender(std::shared_ptr<Rpc> rpc, const ClientOptions& options, PackedMesh* mesh, const CallOptions& call,
             const Callbacks& callbacks, Deadline deadline);

  // Puts the mesh into `spec`, or the name of a complete upload of it. Goes on where an upload broke, for
  // reattach_seconds without any progress. Throws MESH_TOO_LARGE before anything is sent, CANCELLED after a stop,
  // CONNECTION_LOST, and what the server refuses an upload with.
  void Send(v1::JobSpec& spec) {
    if (GoesInline()) {
      if (!mesh_->draco.empty()) spec.set_draco(std::move(mesh_->draco));
    } else if (spec.upload().empty()) {
      spec.set_upload(Upload());
    }
  }

  // Whether `error` says that the upload in `spec` is gone; takes it out, so that the next Send() begins again. Not
  // without end.
  bool ForgetUpload(const Error& error, v1::JobSpec& spec) {
    if (spec.upload().empty() || !IsUploadGone(error)) return false;
    spec.clear_upload();
    return ++lost_uploads_ <= kMostLostUploads;
  }

 private:
  using Clock = std::chrono::steady_clock;

  static constexpr int kMostLostUploads = 3;

  bool GoesInline();
  std::string Upload();
  // Sends what the server does not have yet over one stream.
  void WriteRest(v1::Upload& upload);
  void Resume(v1::Upload& upload, const Error& why);
  void Pause(const Error& why);
  void OnProgress(std::int64_t committed);
  static bool IsUploadGone(const Error& error);
  [[noreturn]] static void ThrowCancelled();

  const std::shared_ptr<Rpc> rpc_;
  const ClientOptions options_;
  PackedMesh* const mesh_;
  const std::stop_token stop_;
  const Callbacks& callbacks_;
  const Deadline deadline_;

  std::optional<bool> inline_;
  std::int64_t chunk_bytes_ = 0;
  int lost_uploads_ = 0;
  Backoff backoff_;
  std::int64_t best_ = -1;                 // committed bytes at most so far
  std::optional<Clock::time_point> lost_;  // when the trouble began that nothing came through since

  // Guarded by mutex_: what a stop from another thread touches.
  std::mutex mutex_;
  std::condition_variable_any stopped_changed_;
  std::unique_ptr<UploadStream> stream_;
};

}  // namespace abi0
}  // namespace planish
