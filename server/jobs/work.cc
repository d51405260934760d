#include "server/jobs/work.h"

#include <utility>

namespace planish {

void Work::SendCancel() {
  cancelled = true;
  if (link == nullptr) return;
  worker::v1::ToWorker message;
  message.mutable_cancel();
  link->Send(std::move(message));
}

void Work::SendStop() {
  stopped = true;
  if (link == nullptr) return;
  worker::v1::ToWorker message;
  message.mutable_stop();
  link->Send(std::move(message));
}

}  // namespace planish
