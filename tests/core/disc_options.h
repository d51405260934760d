// Options for tests of the solver: one chart, no seams.
#pragma once

#include "core/unwrap/unwrap.h"

namespace planish::testing {

inline UnwrapOptions AsDisc(UnwrapOptions options = {}) {
  options.seams.policy = SeamPolicy::kNone;
  return options;
}

}  // namespace planish::testing
