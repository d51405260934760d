#pragma once

namespace planish {

// Unwraps a small mesh in vain: what libraries load or start at their first use is there afterwards, so that a sandbox
// does not get in its way and the first job is as quick as others. Some milliseconds.
void WarmUp();

}  // namespace planish
