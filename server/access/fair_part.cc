#include "server/access/fair_part.h"

namespace planish {

bool HasFairPart(std::int64_t own, std::int64_t total, std::int64_t more, std::int64_t limit, std::int64_t tenants) {
  // `total + more <= limit` could overflow, since a request may ask for almost the largest number.
  return more <= limit - total || more <= limit / tenants - own;
}

}  // namespace planish
