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

// Claims per second of all servers of a farm together, not counting the time that claims take. Each server makes one
// claim per interval; with more servers the interval is longer, and each claim takes more work.
inline constexpr double kClaimsPerSecond = 250;
inline constexpr absl::Duration kLeastClaimInterval = absl::Milliseconds(20);  // a shorter interval counts as 0

// Renewals per lease duration.
inline constexpr int kRenewalsPerLease = 3;

// Interval between two requests of one server, if `servers` servers share the store and all of them together shall make
// `per_second` requests of this kind. Zero if that interval is less than `least`.
inline absl::Duration SharedPace(int servers, double per_second, absl::Duration least) {
  const absl::Duration pace = absl::Seconds(servers / per_second);
  return pace > least ? pace : absl::ZeroDuration();
}

// Backs off when the database is overloaded: servers then claim less often, and take more work with each claim. More
// concurrent claims would only make the queue for the database longer.
//
// If n servers together make c claims per second, each has n / c seconds for a rest and a claim. So a claim queues for
// about n / c / kRests, however overloaded the database is. The median of the last claims counts, since a single slow
// claim may be a pause of the database.
class ClaimPace {
 public:
  // `owner`: the owner of this server's leases.
  explicit ClaimPace(const std::string& owner)
      : place_(static_cast<double>(std::hash<std::string>()(owner) % 1000) / 1000),
        random_(static_cast<unsigned>(std::hash<std::string>()(owner))) {}

  // Time of the next claim, after one that queued for `queued` (JobStore::Claim). Each server has its own offset within
  // the interval, and the rest varies by up to a half, so that servers that waited for the same thing do not go on
  // claiming at the same moment.
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
  // Queueing time of a claim when the database is not busy.
  static constexpr absl::Duration kPrompt = absl::Milliseconds(2);
  // Rest, in multiples of the queueing time beyond kPrompt.
  static constexpr int kRests = 200;
  static constexpr int kMostIntervals = 5;  // longest rest: all servers together still make 50 claims a second

  absl::Duration Median() const {
    std::array<absl::Duration, kLast> sorted = last_;
    std::sort(sorted.begin(), sorted.end());
    return sorted[kLast / 2];
  }

  const double place_;
  std::minstd_rand random_;
  std::array<absl::Duration, kLast> last_ = {};  // queueing times of the last claims; zeros at first
  std::size_t count_ = 0;
};

}  // namespace planish
