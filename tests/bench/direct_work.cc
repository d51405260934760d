#include "tests/bench/direct_work.h"

#include <stdexcept>
#include <string>

#include "core/base/timer.h"
#include "core/draco/codec.h"
#include "core/unwrap/unwrap.h"
#include "server/worker/options.h"

namespace planish::bench {
namespace {

template <typename T>
T Must(absl::StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(result.status().ToString());
  return *std::move(result);
}

}  // namespace

DirectSeconds WorkDirectly(const Mesh& mesh) {
  DirectSeconds seconds;
  Timer timer;
  const Mesh decoded = Must(DecodeDraco(Must(EncodeDraco(mesh))));
  seconds.draco = timer.Seconds();
  timer.Restart();
  Must(Unwrap(decoded, Must(ToCore(v1::UnwrapOptions())), UnwrapControl()));
  seconds.solve = timer.Seconds();
  return seconds;
}

}  // namespace planish::bench
