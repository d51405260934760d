// The one policy of retries, by itself: nothing is waited for.
#include "client/src/retry.h"

#include "gtest/gtest.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using testing::ErrorOf;

const Retry::Limits kLimits = {Seconds(10), Seconds(20), Seconds(1), {}};

Error Unavailable() {
  return Error(ErrorCode::kUnavailable, "UNAVAILABLE", "Socket closed");
}

Error Full(Seconds pause) {
  return Error(ErrorCode::kResourceExhausted, "QUEUE_FULL", "full").set_retry_after(pause);
}

TEST(RetryPolicy, PausesDoubleAfterLossesAndBeginAnewAfterProgress) {
  Retry retry("host:1", kLimits);
  for (const double most : {1.0, 2.0, 4.0, 5.0, 5.0}) {
    const Seconds pause = retry.PauseAfter(Unavailable(), true);
    EXPECT_GE(pause.count(), most / 2);
    EXPECT_LE(pause.count(), most);
  }
  retry.Reset();
  EXPECT_LE(retry.PauseAfter(Unavailable(), true).count(), 1);
  EXPECT_EQ(retry.PauseAfter(Unavailable().set_retry_after(Seconds(9)), true), Seconds(9)) << "the server's own pace";
}

TEST(RetryPolicy, RoomIsWaitedForAtTheServersPace) {
  Retry retry("host:1", kLimits);
  EXPECT_EQ(retry.PauseAfter(Full(Seconds(15)), true), Seconds(15)) << "the limit for room counts";
  EXPECT_EQ(retry.PauseAfter(Full(Seconds(0)), true), Seconds(0.05));
  EXPECT_EQ(ErrorOf([&] { retry.PauseAfter(Full(Seconds(30)), true); }).reason(), "QUEUE_FULL");
}

TEST(RetryPolicy, WhatDoesNotPassIsNotRetried) {
  Retry retry("host:1", kLimits);
  EXPECT_EQ(ErrorOf([&] { retry.PauseAfter(Unavailable(), false); }).reason(), "UNAVAILABLE") << "never reached";
  for (const Error& error :
       {Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID", "no"), Error(ErrorCode::kInternal, "SOLVER_FAILED", "no"),
        Error(ErrorCode::kResourceExhausted, "MEMORY_LIMIT", "no")}) {
    EXPECT_EQ(ErrorOf([&] { retry.PauseAfter(error, true); }).reason(), error.reason());
  }
  EXPECT_GT(retry.PauseAfter(Error(ErrorCode::kInternal, "INTERNAL", "RST_STREAM"), true), Seconds(0)) << "the network";
}

TEST(RetryPolicy, LimitsEnd) {
  Retry::Limits limits = kLimits;
  limits.lost = Seconds(1.5);
  Retry retry("host:1", limits);
  retry.PauseAfter(Unavailable(), true);
  const Error lost = ErrorOf([&] { retry.PauseAfter(Unavailable().set_retry_after(Seconds(2)), true); });
  EXPECT_EQ(lost.reason(), "CONNECTION_LOST");
  EXPECT_EQ(lost.code(), ErrorCode::kUnavailable);
  limits.lost = Seconds(0);
  EXPECT_EQ(ErrorOf([&] { Retry("host:1", limits).PauseAfter(Unavailable(), true); }).reason(), "UNAVAILABLE");
  limits = kLimits;
  limits.deadline = DeadlineAfter(Seconds(1e-9));
  EXPECT_EQ(ErrorOf([&] { Retry("host:1", limits).PauseAfter(Unavailable(), true); }).code(),
            ErrorCode::kDeadlineExceeded);
}

}  // namespace
}  // namespace planish
