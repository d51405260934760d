// When a server of a farm claims work again.
#pragma once

#include <algorithm>
#include <functional>
#include <random>
#include <string>

#include "absl/time/time.h"

namespace planish {

// Claims that all servers of a farm make together in a second, if they take no time: each server has one in an
// interval, which is the longer the more servers there are, and takes more with it.
inline constexpr double kClaimsPerSecond = 250;

// A database that is asked for more than it can give answers late. Then servers ask less often, and take more with each
// claim: those that queue for an answer would get nothing sooner, and be in the way of all others.
class ClaimPace {
 public:
  // `owner`: of the server's leases.
  explicit ClaimPace(const std::string& owner)
      : place_(static_cast<double>(std::hash<std::string>()(owner) % 1000) / 1000),
        random_(static_cast<unsigned>(std::hash<std::string>()(owner))) {}

  // After a claim that took so long: at this server's place in an interval, after a rest that varies by a half. Servers
  // that once waited for the same thing would otherwise come together from then on.
  absl::Time Next(absl::Time now, absl::Duration interval, absl::Duration took) {
    if (interval <= absl::ZeroDuration()) return now;
    const absl::Duration rest = std::min(kRests * std::max(took - kPrompt, absl::ZeroDuration()), kLongestRest);
    const absl::Time rested = now + rest * std::uniform_real_distribution<double>(0.5, 1.5)(random_);
    return rested + interval - (rested - absl::UnixEpoch() + place_ * interval) % interval;
  }

 private:
  static constexpr absl::Duration kPrompt = absl::Milliseconds(10);  // of a database that has time
  static constexpr int kRests = 50;                                  // times what a claim took beyond that
  static constexpr absl::Duration kLongestRest = absl::Seconds(4);

  const double place_;
  std::minstd_rand random_;
};

}  // namespace planish
