// When a server of a farm asks the store again: for work, and to renew its leases.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <random>
#include <string>

#include "absl/time/time.h"

namespace planish {

// Claims that all servers of a farm make together in a second, if they take no time: each server has one in an
// interval, which is the longer the more servers there are, and takes more with it.
inline constexpr double kClaimsPerSecond = 250;
inline constexpr absl::Duration kLeastClaimInterval = absl::Milliseconds(20);  // less is none

// Renewals in the time that a lease lasts.
inline constexpr int kRenewalsPerLease = 3;

// The time between two things of one kind that each of so many servers asks of the store they share, so that all of
// them together ask `per_second`. Zero where that is less than `least`.
inline absl::Duration SharedPace(int servers, double per_second, absl::Duration least) {
  const absl::Duration pace = absl::Seconds(servers / per_second);
  return pace > least ? pace : absl::ZeroDuration();
}

// A database that is asked for more than it can give answers late. Then servers ask less often, and take more with each
// claim: those that queue for an answer would get nothing sooner, and be in the way of all others.
//
// Where n servers take c claims a second together, each has n / c seconds for a rest and a claim. So a claim queues for
// about n / c / kRests, however much more work there is than the database can give. The median of the last claims
// counts: one that met a pause of the database says nothing.
class ClaimPace {
 public:
  // `owner`: of the server's leases.
  explicit ClaimPace(const std::string& owner)
      : place_(static_cast<double>(std::hash<std::string>()(owner) % 1000) / 1000),
        random_(static_cast<unsigned>(std::hash<std::string>()(owner))) {}

  // After a claim that queued so long (JobStore::Claim): at this server's place in an interval, after a rest that
  // varies by a half. Servers that once waited for the same thing would otherwise come together from then on.
  absl::Time Next(absl::Time now, absl::Duration interval, absl::Duration queued) {
    last_[count_++ % kLast] = queued;
    if (interval <= absl::ZeroDuration()) return now;
    const absl::Duration rest =
        std::min(kRests * std::max(Median() - kPrompt, absl::ZeroDuration()), kMostIntervals * interval);
    const absl::Time rested = now + rest * std::uniform_real_distribution<double>(0.5, 1.5)(random_);
    return rested + interval - (rested - absl::UnixEpoch() + place_ * interval) % interval;
  }

 private:
  static constexpr std::size_t kLast = 3;
  static constexpr absl::Duration kPrompt = absl::Milliseconds(2);  // of a database that has time
  static constexpr int kRests = 200;                                // times what a claim queued beyond that
  static constexpr int kMostIntervals = 5;  // of a rest: all servers together make 50 claims a second at least

  absl::Duration Median() const {
    std::array<absl::Duration, kLast> sorted = last_;
    std::sort(sorted.begin(), sorted.end());
    return sorted[kLast / 2];
  }

  const double place_;
  std::minstd_rand random_;
  std::array<absl::Duration, kLast> last_ = {};  // at first: none queued
  std::size_t count_ = 0;
};

}  // namespace planish
