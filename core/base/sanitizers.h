// Whether this is a build with sanitizers.
#pragma once

namespace planish {

// Whether the address or the thread sanitizer is built in. Such a program reserves terabytes of addresses, needs extra
// files and processes, fails under a memory limit, and is slow.
#if defined(__SANITIZE_ADDRESS__) || defined(_GLIBCXX_TSAN)  // the latter is set by PlanishTargets.cmake
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace planish
