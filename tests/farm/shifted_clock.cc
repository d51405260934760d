// Preloaded into a program (LD_PRELOAD), gives it a clock that is wrong by CLOCK_SHIFT seconds.
#include <dlfcn.h>

#include <cstdlib>
#include <ctime>

extern "C" int clock_gettime(clockid_t id, timespec* time) noexcept {
  using Function = int (*)(clockid_t, timespec*);
  static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "clock_gettime"));
  const int result = real(id, time);
  const char* const shift = std::getenv("CLOCK_SHIFT");
  if (id == CLOCK_REALTIME && shift != nullptr) time->tv_sec += std::atol(shift);
  return result;
}
