#pragma once

namespace planish {

// Unwraps a small mesh and discards the result. Afterwards, everything that libraries load or start at their first use
// exists, so that the sandbox does not block it and the first job is as fast as others. Takes some milliseconds.
void WarmUp();

}  // namespace planish
