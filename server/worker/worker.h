// A worker: what runs at the far end of a link.
#pragma once

#include "server/link/worker_link.h"

namespace planish {

// Serves one job over `server`: waits for its WorkRequest, sends events and the result, hangs up. A CancelRequest or
// a closed link interrupts the work.
void RunWorker(ServerLink& server);

}  // namespace planish
