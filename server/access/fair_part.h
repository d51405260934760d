// How much a tenant may take of something that all tenants share.
#pragma once

#include <cstdint>

namespace planish {

// Whether a tenant may take `more`, if it has `own` now and all tenants together have `total`. It may if the total
// stays within `limit`, or if the tenant itself stays within an equal part, limit / tenants. `tenants` (>= 1) is the
// number of tenants that have any, this one included. So a tenant that takes everything cannot keep others out.
//
// The total is at most limit (1 + 1/2 + ... + 1/n) with n tenants. Proof: order the tenants by what they have, most
// first, and consider the last time that one of the first i took something. Either the total was then within the limit,
// so that the least of the i tenants has at most limit / i; or all of them had some, so that tenants >= i and the one
// that took it has at most limit / i, and so has the least of the i. Returning something only lowers the total.
bool HasFairPart(std::int64_t own, std::int64_t total, std::int64_t more, std::int64_t limit, std::int64_t tenants);

}  // namespace planish
