// What a tenant may have of something that all tenants have to share.
#pragma once

#include <cstdint>

namespace planish {

// Whether a tenant that has `own` of what all have, `total`, may take `more`: as long as that is within `limit` for
// all, and beyond it up to an equal part of `limit` for each of `tenants` (those that have any, and this one; >= 1). So
// a tenant that takes all there is keeps nobody else out.
//
// The bound on all that is taken: limit (1 + 1/2 + ... + 1/n) with n tenants. For let the tenants be in the order of
// what they have, most first, and look at the last thing that any of the first i of them took. Either the total was
// within the limit then, so that the least of the i has at most limit / i; or they all had some then, tenants >= i, and
// whoever took it has at most limit / i, as has the least of the i. What goes away again only helps.
bool HasFairPart(std::int64_t own, std::int64_t total, std::int64_t more, std::int64_t limit, std::int64_t tenants);

}  // namespace planish
