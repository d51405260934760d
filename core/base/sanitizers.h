// Whether this is a build with sanitizers.
#pragma once

namespace planish {

// The address or the thread sanitizer is in it: it wants terabytes of addresses, files and processes for itself, takes
// a limit on memory for its own, and is slow.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace planish
