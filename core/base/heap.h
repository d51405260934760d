// The process's heap between one large piece of work and the next. For programs, not for libraries, and from one
// thread.
#pragma once

namespace planish {

// From now on memory that is freed stays with the process, and memory that is taken comes in huge pages where the
// kernel gives them (transparent huge pages, "madvise" or "always"). The solver takes and frees vectors of tens of
// megabytes all the time; handing each back to the kernel and having it zeroed again costs a tenth of a solve, and so
// do small pages.
void KeepFreedMemory();

// Hands back what is free.
void ReturnFreedMemory();

}  // namespace planish
