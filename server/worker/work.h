// One job, from request to result, on the calling thread.
#pragma once

#include <functional>
#include <optional>

#include "core/base/interrupter.h"
#include "planish/worker/v1/worker.pb.h"

namespace planish {

// Thins out progress: every change of stage passes; with one chart every Newton iteration too, and every report between
// two linear solves. Anything else, as the Newton iterations of a thousand charts, at most every `kIntervalSeconds`.
class ProgressThrottle {
 public:
  static constexpr double kIntervalSeconds = 0.1;

  // Whether to send `progress`, whose elapsed_seconds are set.
  bool Pass(const v1::Progress& progress);

 private:
  std::optional<v1::Progress> last_;  // that passed
};

// Decodes, unwraps, packs. Never throws: whatever goes wrong is the result's status (OUT_OF_MEMORY and INTERNAL for
// exceptions). After an interrupt the result is CANCELLED, as soon as Unwrap() notices.
// `on_progress` is called on this thread, throttled; it must not throw.
worker::v1::WorkResult DoWork(const worker::v1::WorkRequest& request, const Interrupter& interrupter,
                              const std::function<void(const v1::Progress&)>& on_progress);

}  // namespace planish
