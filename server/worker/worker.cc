#include "server/worker/worker.h"

#include <optional>
#include <thread>
#include <utility>

#include "core/base/heap.h"
#include "core/base/interrupter.h"
#include "server/worker/work.h"

namespace planish {
namespace {

using worker::v1::FromWorker;
using worker::v1::ToWorker;

// Interrupts the work when the server says so or is gone. Ends when the link is closed.
void Listen(ServerLink& server, Interrupter* interrupter) {
  while (const std::optional<ToWorker> message = server.Receive()) {
    if (message->has_cancel()) interrupter->Interrupt();
  }
  interrupter->Interrupt();
}

}  // namespace

void RunWorker(ServerLink& server) {
  const std::optional<ToWorker> message = server.Receive();
  if (!message.has_value() || !message->has_request()) return;

  Interrupter interrupter;
  std::thread listener(Listen, std::ref(server), &interrupter);
  FromWorker answer;
  *answer.mutable_result() = DoWork(message->request(), interrupter, [&server](const v1::Progress& progress) {
    FromWorker event;
    *event.mutable_event()->mutable_progress() = progress;
    server.Send(std::move(event));
  });
  server.Send(std::move(answer));
  server.Close();
  listener.join();
  ReturnFreedMemory();
}

}  // namespace planish
