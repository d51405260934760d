#include "client/src/request_id.h"

#include <cstdio>
#include <random>

namespace planish {

std::string NewRequestId() {
  std::random_device random;
  char text[37];
  std::snprintf(text, sizeof text, "%08x-%04x-4%03x-%04x-%08x%04x", random(), random() & 0xffffU, random() & 0xfffU,
                (random() & 0x3fffU) | 0x8000U, random(), random() & 0xffffU);
  return text;
}

}  // namespace planish
