#include "tests/testing/fake_workers.h"

#include <optional>
#include <utility>

#include "core/base/sha256.h"
#include "server/link/in_process_link.h"
#include "server/link/rpc_status.h"

namespace planish {

using worker::v1::FromWorker;

WorkerFactory ScriptedWorkers(WorkerScript script) {
  return [script = std::move(script)] {
    return StartInProcessWorker([script](ServerLink& server) {
      server.Send(IdleMessage());
      while (const std::optional<ServerLink::Received> received = server.Receive()) {
        if (!received->message.has_request()) continue;  // to a job that is over
        if (!script(server, *received)) return;
        server.Send(IdleMessage());
      }
    });
  };
}

FromWorker IdleMessage() {
  FromWorker message;
  message.mutable_idle();
  return message;
}

FromWorker ProgressMessage(int newton_iteration) {
  FromWorker message;
  v1::Progress* progress = message.mutable_event()->mutable_progress();
  progress->set_stage(v1::STAGE_SOLVE);
  progress->set_newton_iteration(newton_iteration);
  return message;
}

FromWorker SuccessMessage(const std::string& uv_bytes) {
  FromWorker message;
  worker::v1::WorkResult* result = message.mutable_result();
  result->mutable_report()->mutable_input()->set_triangles(1);
  result->mutable_uv()->set_total_bytes(static_cast<std::int64_t>(uv_bytes.size()));
  result->mutable_uv()->set_uv_sha256(Sha256(uv_bytes));
  return message;
}

FromWorker FailureMessage(const absl::Status& status) {
  FromWorker message;
  *message.mutable_result()->mutable_status() = ToRpcStatus(status);
  return message;
}

FromWorker CancelledMessage() {
  return FailureMessage(absl::CancelledError("cancelled"));
}

void SendSuccess(ServerLink& server, const std::string& uv_bytes) {
  server.Send(SuccessMessage(uv_bytes), *Blob::Copy(uv_bytes));
}

WorkerScript Succeed(int iterations, const std::string& uv_bytes) {
  return [iterations, uv_bytes](ServerLink& server, const ServerLink::Received&) {
    for (int i = 1; i <= iterations; ++i) server.Send(ProgressMessage(i));
    SendSuccess(server, uv_bytes);
    return true;
  };
}

WorkerScript WaitForCancel() {
  return [](ServerLink& server, const ServerLink::Received&) {
    server.Send(ProgressMessage(1));
    while (const std::optional<ServerLink::Received> received = server.Receive()) {
      if (!received->message.has_cancel()) continue;
      server.Send(CancelledMessage());
      return true;
    }
    return false;
  };
}

void Gate::Open() {
  const std::lock_guard lock(mutex_);
  open_ = true;
  opened_.notify_all();
}

void Gate::Wait() {
  std::unique_lock lock(mutex_);
  opened_.wait(lock, [this] { return open_; });
}

}  // namespace planish
