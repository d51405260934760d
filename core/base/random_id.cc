#include "core/base/random_id.h"

#include <cinttypes>
#include <cstdio>
#include <random>

namespace planish {

std::uint64_t Entropy() {
  thread_local std::random_device random;  // opening it takes longer than reading it
  return (std::uint64_t{random()} << 32) | random();
}

std::string NewUuid() {
  const std::uint64_t high = Entropy(), low = Entropy();
  char text[37];
  std::snprintf(text, sizeof text, "%08" PRIx64 "-%04" PRIx64 "-4%03" PRIx64 "-%04" PRIx64 "-%012" PRIx64, high >> 32,
                high >> 16 & 0xffffU, high & 0xfffU, (low >> 48 & 0x3fffU) | 0x8000U, low & 0xffffffffffffU);
  return text;
}

}  // namespace planish
