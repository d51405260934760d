#include "server/rpc/upload_reactor.h"

#include <memory>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

absl::Status FieldInvalid(const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", field}});
}

absl::Status Draining() {
  constexpr absl::Duration kRetryDelay = absl::Seconds(1);
  return WithRetryDelay(MakeError(absl::StatusCode::kUnavailable, "DRAINING",
                                  "the server is shutting down; continue the upload at committed_bytes"),
                        kRetryDelay);
}

// At any time either a read or a task runs, never both, so the task's data need no lock.
class UploadReactor : public Call, public Interruptible {
 public:
  UploadReactor(CallInfo call, UploadStore* uploads, std::int64_t max_chunk_bytes, TaskThreads* tasks,
                StreamCounter* streams)
      : Call(std::move(call)), uploads_(uploads), max_chunk_bytes_(max_chunk_bytes), tasks_(tasks), streams_(streams) {}

  void Interrupt() override {
    {
      const std::lock_guard lock(mutex_);
      interrupted_ = true;
      if (busy_ || std::exchange(finished_, true)) return;  // the task will finish the call
    }
    Conclude(Draining());
  }

 private:
  void OnBegin() override { streams_->AddSender(Self()); }

  void OnMessage(ReceivedMessagePtr message) override { Go(std::move(message)); }
  void OnNoMessage() override { Go(nullptr); }

  void OnRefused(const absl::Status& status) override {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(finished_, true)) return;
    }
    Conclude(status);
  }

  std::shared_ptr<UploadReactor> Self() { return std::static_pointer_cast<UploadReactor>(shared_from_this()); }

  // Starts a task for `message`; null: there are no more messages.
  void Go(ReceivedMessagePtr message) {
    {
      const std::lock_guard lock(mutex_);
      if (finished_) return;  // Interrupt() ended the read
      busy_ = true;
    }
    tasks_->Post(info().caller.tenant, [self = Self(), message = std::move(message)] {
      message != nullptr ? self->Append(*message) : self->Conclude(self->Answer());
    });
  }

  void Append(ReceivedMessage& message) {
    absl::Status status = Take(message);
    {
      const std::lock_guard lock(mutex_);
      busy_ = false;
      if (status.ok() && interrupted_) status = Draining();
      finished_ = !status.ok();
      if (!finished_) {
        Read();  // under the lock, so that Interrupt() cannot end the call first
        return;
      }
    }
    Conclude(status);
  }

  // Finishes the call. Requires that no read and no task runs or will run.
  void Conclude(const absl::StatusOr<v1::Upload>& upload) {
    writer_ = UploadWriter();  // gives up the upload before the caller gets the answer and may come back
    upload.ok() ? EndWith(*upload) : End(upload.status());
  }

  absl::Status Take(ReceivedMessage& message) {
    v1::WriteUploadRequest request;
    PLANISH_RETURN_IF_ERROR(message.Parse(&request));
    if (writer_.name().empty()) {
      if (request.name().empty()) return FieldInvalid("name", "the first message must name the upload");
      PLANISH_ASSIGN_OR_RETURN(writer_, uploads_->Write(info().caller, request.name()));
    } else if (!request.name().empty() && request.name() != writer_.name()) {
      return FieldInvalid("name", "one call writes to one upload");
    }
    if (static_cast<std::int64_t>(request.data().size()) > max_chunk_bytes_) {
      return FieldInvalid(
          "data", absl::StrCat("data has ", request.data().size(), " bytes; a message may have ", max_chunk_bytes_));
    }
    return writer_.Append(request.offset(), request.data());
  }

  // The answer after the caller's last message.
  absl::StatusOr<v1::Upload> Answer() {
    if (writer_.name().empty()) return FieldInvalid("name", "the call has no message");
    return uploads_->Get(info().caller, writer_.name());
  }

  UploadStore* const uploads_;
  const std::int64_t max_chunk_bytes_;
  TaskThreads* const tasks_;
  StreamCounter* const streams_;
  UploadWriter writer_;

  std::mutex mutex_;
  // Guarded by mutex_.
  bool busy_ = false;  // a task is running
  bool interrupted_ = false;
  bool finished_ = false;
};

}  // namespace

std::shared_ptr<Call> ReceiveUpload(CallInfo info, UploadStore* uploads, std::int64_t max_chunk_bytes,
                                    TaskThreads* tasks, StreamCounter* streams) {
  return std::make_shared<UploadReactor>(std::move(info), uploads, max_chunk_bytes, tasks, streams);
}

}  // namespace planish
