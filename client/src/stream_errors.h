// What an error of a stream means for those who want to go on.
#pragma once

#include "client/src/rpc.h"

namespace planish {
inline namespace abi0 {

// Whether a stream broke under way, so that the same call may succeed a moment later.
bool IsBrokenStream(const Error& error);

// Whether there was no connection at all.
bool IsUnreachable(const Error& error);

// Whether the server is full and says when to come back.
bool AsksToWait(const Error& error);

// Throws DEADLINE_EXCEEDED if `deadline` passes within a pause of so many seconds; `why` there is a pause.
void ThrowIfLate(Deadline deadline, double pause_seconds, const Error& why);

}  // namespace abi0
}  // namespace planish
