#include "server/rpc/upload_reactor.h"

#include <memory>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/link/rpc_status.h"
#include "server/rpc/grpc_status.h"

namespace planish {
namespace {

absl::Status FieldInvalid(const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", field}});
}

absl::Status Draining() {
  constexpr absl::Duration kRetryDelay = absl::Seconds(1);
  return WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                  "the server is shutting down; the upload goes on where committed_bytes says"),
                        kRetryDelay);
}

// Either a read or a task is under way, never both, and the task's data need no lock. Owns itself until gRPC is done
// with it.
class UploadReactor : public grpc::ServerReadReactor<v1::WriteUploadRequest>,
                      public Interruptible,
                      public std::enable_shared_from_this<UploadReactor> {
 public:
  static UploadReactor* Start(const absl::StatusOr<Caller>& caller, UploadStore* uploads, std::int64_t max_chunk_bytes,
                              TaskThreads* tasks, StreamCounter* streams, v1::Upload* response) {
    const auto reactor =
        std::make_shared<UploadReactor>(caller.ok() ? *caller : Caller(), uploads, max_chunk_bytes, tasks, response);
    reactor->self_ = reactor;
    if (!caller.ok()) {
      reactor->Finish(ToGrpcStatus(caller.status()));
      return reactor.get();
    }
    reactor->StartRead(&reactor->request_);
    streams->AddSender(reactor);
    return reactor.get();
  }

  UploadReactor(const Caller& caller, UploadStore* uploads, std::int64_t max_chunk_bytes, TaskThreads* tasks,
                v1::Upload* response)
      : caller_(caller), uploads_(uploads), max_chunk_bytes_(max_chunk_bytes), tasks_(tasks), response_(response) {}

  void OnReadDone(bool ok) override {
    {
      const std::lock_guard lock(mutex_);
      if (finished_) return;  // Interrupt() ended the read
      busy_ = true;
    }
    tasks_->Post(caller_.tenant, [self = shared_from_this(), ok] { self->Go(ok); });
  }

  void Interrupt() override {
    {
      const std::lock_guard lock(mutex_);
      interrupted_ = true;
      if (busy_ || std::exchange(finished_, true)) return;  // the task sees to it
    }
    End(Draining());
  }

  void OnDone() override { self_.reset(); }

 private:
  void Go(bool ok) {
    absl::Status status = ok ? Take() : Answer();
    {
      const std::lock_guard lock(mutex_);
      busy_ = false;
      if (ok && status.ok() && interrupted_) status = Draining();
      finished_ = !ok || !status.ok();
      if (!finished_) {
        StartRead(&request_);  // under the lock: Interrupt() must not come before it
        return;
      }
    }
    End(status);
  }

  // Requires that this thread set finished_.
  void End(const absl::Status& status) {
    writer_ = UploadWriter();  // before the caller hears of it, and may come back
    Finish(ToGrpcStatus(status));
  }

  absl::Status Take() {
    if (writer_.name().empty()) {
      if (request_.name().empty()) return FieldInvalid("name", "the first message must name the upload");
      PLANISH_ASSIGN_OR_RETURN(writer_, uploads_->Write(caller_, request_.name()));
    } else if (!request_.name().empty() && request_.name() != writer_.name()) {
      return FieldInvalid("name", "one call writes to one upload");
    }
    if (static_cast<std::int64_t>(request_.data().size()) > max_chunk_bytes_) {
      return FieldInvalid(
          "data", absl::StrCat("data has ", request_.data().size(), " bytes; a message may have ", max_chunk_bytes_));
    }
    return writer_.Append(request_.offset(), request_.data());
  }

  // The caller has sent all it wants to send, or is gone.
  absl::Status Answer() {
    if (writer_.name().empty()) return FieldInvalid("name", "the call has no message");
    PLANISH_ASSIGN_OR_RETURN(*response_, uploads_->Get(caller_, writer_.name()));
    return absl::OkStatus();
  }

  const Caller caller_;
  UploadStore* const uploads_;
  const std::int64_t max_chunk_bytes_;
  TaskThreads* const tasks_;
  v1::Upload* const response_;
  v1::WriteUploadRequest request_;
  UploadWriter writer_;

  // Set by Start(), dropped by OnDone().
  std::shared_ptr<UploadReactor> self_;

  std::mutex mutex_;
  // Guarded by mutex_.
  bool busy_ = false;  // a task is under way
  bool interrupted_ = false;
  bool finished_ = false;
};

}  // namespace

grpc::ServerReadReactor<v1::WriteUploadRequest>* ReceiveUpload(const absl::StatusOr<Caller>& caller,
                                                               UploadStore* uploads, std::int64_t max_chunk_bytes,
                                                               TaskThreads* tasks, StreamCounter* streams,
                                                               v1::Upload* response) {
  return UploadReactor::Start(caller, uploads, max_chunk_bytes, tasks, streams, response);
}

}  // namespace planish
