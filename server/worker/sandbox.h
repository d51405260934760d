// The privileges that a worker process gives up before it gets its first mesh.
#pragma once

#include "absl/status/status.h"

namespace planish {

// From now on, the kernel refuses (EPERM), for all threads of this process, every system call that decoding, unwrapping
// and talking to the server do not need: no files, no sockets, no programs, no processes, no signals to others, no
// memory that is both written to and executed. Still allowed: memory, threads, clocks, and descriptors that are open or
// come over the link. This cannot be undone.
//
// Call it after everything that libraries load late has been used once. UNAVAILABLE with the kernel's reason if it
// accepts no filter, and in builds with sanitizers, which need more system calls.
absl::Status EnterSandbox();

// Settings with or without a sandbox: the process ends with the thread that started it, gains no privileges, leaves no
// core file (it would hold a caller's mesh), opens few descriptors, and is the first to be killed when the machine's
// memory runs out.
void ConfineProcess();

}  // namespace planish
