#include "server/rpc/upload_reactor.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/rpc/grpc_status.h"

namespace planish {
namespace {

absl::Status FieldInvalid(const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", field}});
}

// Either a read or a task is under way, never both, so nothing needs a lock.
class UploadReactor : public grpc::ServerReadReactor<v1::WriteUploadRequest> {
 public:
  UploadReactor(const absl::StatusOr<Caller>& caller, UploadStore* uploads, std::int64_t max_chunk_bytes,
                TaskThreads* tasks, v1::Upload* response)
      : caller_(caller.ok() ? *caller : Caller()),
        uploads_(uploads),
        max_chunk_bytes_(max_chunk_bytes),
        tasks_(tasks),
        response_(response) {
    if (caller.ok()) {
      StartRead(&request_);
    } else {
      Finish(ToGrpcStatus(caller.status()));
    }
  }

  void OnReadDone(bool ok) override {
    tasks_->Post([this, ok] {
      const absl::Status status = ok ? Take() : End();
      if (ok && status.ok()) {
        StartRead(&request_);
      } else {
        writer_ = UploadWriter();  // before the caller hears of it, and may come back
        Finish(ToGrpcStatus(status));
      }
    });
  }

  void OnDone() override { delete this; }

 private:
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
  absl::Status End() {
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
};

}  // namespace

grpc::ServerReadReactor<v1::WriteUploadRequest>* ReceiveUpload(const absl::StatusOr<Caller>& caller,
                                                               UploadStore* uploads, std::int64_t max_chunk_bytes,
                                                               TaskThreads* tasks, v1::Upload* response) {
  return new UploadReactor(caller, uploads, max_chunk_bytes, tasks, response);
}

}  // namespace planish
