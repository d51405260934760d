#include "client/src/retry.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace planish {
namespace {

constexpr Seconds kLongestPause{5};
constexpr Seconds kLeastPauseForRoom{0.05};

// Whether the server is full and says when to retry.
bool AsksToWait(const Error& error) {
  return error.code() == ErrorCode::kResourceExhausted &&
         (error.retry_after() > Seconds(0) || error.reason() == "QUEUE_FULL");
}

// Whether `error` means a lost connection or upload, so that the same call may succeed soon.
bool IsLoss(const Error& error) {
  if (error.code() == ErrorCode::kUnavailable || IsUploadGone(error)) return true;
  if (error.reason() == "UPLOAD_BUSY" || error.reason() == "UPLOAD_OFFSET_MISMATCH") return true;
  // Resets and broken frames come from the transport; errors of the server have their own reason.
  const bool from_transport = error.reason() == ToString(error.code());
  return from_transport && (error.code() == ErrorCode::kInternal || error.code() == ErrorCode::kUnknown);
}

}  // namespace

Deadline DeadlineAfter(Seconds timeout) {
  using Wall = std::chrono::system_clock;
  if (timeout <= Seconds(0)) return std::nullopt;
  return Wall::now() + std::chrono::duration_cast<Wall::duration>(timeout);
}

bool IsUploadGone(const Error& error) {
  return error.reason() == "UPLOAD_NOT_FOUND" || error.reason() == "UPLOAD_INCOMPLETE";
}

Retry::Retry(std::string target, const Limits& limits) : target_(std::move(target)), limits_(limits) {}

void Retry::Reset() {
  losses_ = 0;
  lost_since_.reset();
  full_since_.reset();
}

Seconds Retry::PauseAfter(const Error& error, bool reached) {
  const bool is_full = AsksToWait(error);
  // A server that was never reached will hardly appear soon, so the call fails at once.
  if (!is_full && (!reached || !IsLoss(error))) throw error;
  Seconds pause = kLeastPauseForRoom;
  if (!is_full) {
    // Jitter, so that clients that lost the same server do not all reconnect at the same time.
    pause = std::min(kLongestPause, limits_.first_pause * std::ldexp(1, std::min(losses_++, 30))) *
            std::uniform_real_distribution(0.5, 1.0)(random_);
  }
  pause = std::max(pause, error.retry_after());
  std::optional<Clock::time_point>& since = is_full ? full_since_ : lost_since_;
  const bool is_first = !since;
  if (is_first) since = Clock::now();
  if (Clock::now() - *since + pause > (is_full ? limits_.full : limits_.lost)) {
    if (is_full || is_first) throw error;
    throw Error(ErrorCode::kUnavailable, "CONNECTION_LOST",
                "lost the planish server at " + target_ + " and could not reach it again within " +
                    std::to_string(std::lround(limits_.lost.count())) + " s: " + error.what());
  }
  if (limits_.deadline && *limits_.deadline - std::chrono::system_clock::now() <= pause) {
    throw Error(ErrorCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
                std::string("the time given to the call passed while waiting: ") + error.what());
  }
  return pause;
}

}  // namespace planish
