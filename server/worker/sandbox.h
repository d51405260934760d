// What a worker process gives up before it sees its first mesh.
#pragma once

#include "absl/status/status.h"

namespace planish {

// From now on, for all threads of this process, the kernel refuses (EPERM) every system call that decoding, unwrapping
// and talking to the server do not need: no files, no sockets, no programs, no processes, no signals to others, no
// memory that is both written to and executed. What is left: memory, threads of its own, the descriptors that are open
// or come over the link, clocks. There is no way back.
//
// Call it after everything that libraries load late was used once. UNAVAILABLE with the kernel's reason where it takes
// no filter, and in builds with sanitizers, which need more calls than that.
absl::Status EnterSandbox();

// Settings that hold with or without a sandbox: the process ends with the thread that started it, gains no privilege by
// any program, leaves no core file (it would hold a caller's mesh), opens few descriptors, and is the first to go when
// the machine's memory runs out.
void ConfineProcess();

}  // namespace planish
