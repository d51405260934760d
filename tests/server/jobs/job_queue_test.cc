#include "server/jobs/job_queue.h"

#include <map>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

using ::testing::ElementsAre;

const absl::Time kNow = absl::FromUnixSeconds(1'000'000);

// A queue with a clock, and limits that a test sets.
class JobQueueTest : public ::testing::Test {
 protected:
  void Open(JobQueueOptions options) {
    options.limits = [this](const std::string& tenant) {
      const auto found = limits_.find(tenant);
      return found == limits_.end() ? TenantLimits() : found->second;
    };
    queue_.emplace(std::move(options));
  }

  void Push(const std::string& name, const std::string& tenant = "a", double seconds = 1, std::int64_t bytes = 1) {
    queue_->Push({name, tenant, kNow, ++number_, bytes, seconds}, now_);
  }
  void PushMany(int count, const std::string& tenant, double seconds = 1) {
    for (int i = 0; i < count; ++i) Push(tenant + std::to_string(number_ + 1), tenant, seconds);
  }

  bool HasRoom(const std::string& tenant = "a", std::int64_t bytes = 1) {
    return queue_->RoomFor(tenant, bytes) == Room::kYes;
  }

  // The worker's next job; its tenant is the first letter of its name.
  std::string Start() {
    const std::optional<std::string> name = queue_->Front(now_);
    if (!name.has_value()) return "";
    queue_->Start(*name, now_);
    return *name;
  }

  void Pass(double seconds) { now_ += absl::Seconds(seconds); }

  // One worker takes `count` jobs, one after the other, each for `seconds`; how many each tenant had.
  std::map<char, int> Serve(int count, const std::function<double(const std::string&)>& seconds) {
    std::map<char, int> served;
    for (int i = 0; i < count; ++i) {
      const std::string name = Start();
      ++served[name[0]];
      Pass(seconds(name));
      queue_->End(name, now_);
    }
    return served;
  }

  static double OneSecond(const std::string&) { return 1; }

  absl::Time now_ = kNow;
  std::int64_t number_ = 0;
  std::map<std::string, TenantLimits> limits_;
  std::optional<JobQueue> queue_;
};

TEST_F(JobQueueTest, FirstInFirstOut) {
  Open({});
  EXPECT_FALSE(queue_->Front(now_).has_value());
  Push("a");
  Push("b");
  Push("c");
  EXPECT_EQ(queue_->Position("a", now_), 0);
  EXPECT_EQ(queue_->Position("c", now_), 2);
  queue_->Remove("b");
  queue_->Remove("unknown");
  EXPECT_EQ(queue_->Position("c", now_), 1);
  EXPECT_EQ(queue_->Front(now_), "a");
  queue_->Remove("a");
  EXPECT_EQ(queue_->Front(now_), "c");
  queue_->Remove("c");
  EXPECT_TRUE(queue_->empty());
}

TEST_F(JobQueueTest, PriorityCountsAsTimeWaited) {
  Open({});
  const auto push = [&](const std::string& name, absl::Duration later, v1::Priority priority) {
    queue_->Push({name, "a", QueueTime(kNow + later, priority), queue_->size(), 1, 1}, now_);
  };
  push("low", absl::ZeroDuration(), v1::PRIORITY_LOW);
  push("normal", absl::Minutes(1), v1::PRIORITY_UNSPECIFIED);
  push("high", absl::Minutes(2), v1::PRIORITY_HIGH);
  push("late high", absl::Minutes(30), v1::PRIORITY_HIGH);
  EXPECT_EQ(queue_->Position("high", now_), 0);
  EXPECT_EQ(queue_->Position("normal", now_), 1);
  EXPECT_EQ(queue_->Position("low", now_), 2) << "waited long enough to be ahead of what came half an hour later";
  EXPECT_EQ(queue_->Position("late high", now_), 3);
}

TEST_F(JobQueueTest, ANameIsThereOnce) {
  Open({.workers = 0, .max_bytes = 1000});
  Push("a", "a", 1, 10);
  Push("b", "a", 1, 10);
  Push("a", "a", 1, 10);
  EXPECT_EQ(queue_->size(), 2);
  EXPECT_EQ(queue_->Front(now_), "b");
  EXPECT_TRUE(HasRoom("a", 980));
  EXPECT_FALSE(HasRoom("a", 981));
}

// ---- room

TEST_F(JobQueueTest, RoomCountsJobsAndIdleWorkers) {
  Open({.workers = 1, .capacity = 1});
  EXPECT_TRUE(HasRoom());
  Push("a");
  EXPECT_TRUE(HasRoom()) << "the worker will take it";
  Start();
  EXPECT_TRUE(HasRoom());
  Push("b");
  EXPECT_EQ(queue_->RoomFor("a", 1), Room::kTenantFull);
}

TEST_F(JobQueueTest, NoPlacesMeansOnlyForIdleWorkers) {
  Open({.workers = 1, .capacity = 0});
  EXPECT_TRUE(HasRoom());
  Push("a");
  EXPECT_FALSE(HasRoom());
  EXPECT_FALSE(HasRoom("b")) << "the worker will take the one that came first";
}

TEST_F(JobQueueTest, RoomCountsBytes) {
  Open({.workers = 0, .max_bytes = 100});
  EXPECT_TRUE(HasRoom("a", 5000)) << "an empty queue takes any mesh";
  Push("a", "a", 1, 60);
  EXPECT_TRUE(HasRoom("a", 40));
  EXPECT_EQ(queue_->RoomFor("a", 41), Room::kServerFull);
  EXPECT_TRUE(HasRoom("b", 5000)) << "to whoever has nothing there it is empty";
  Push("b", "a", 1, 40);
  queue_->Remove("a");
  EXPECT_TRUE(HasRoom("a", 60));
  queue_->Remove("b");
  EXPECT_TRUE(HasRoom("a", 100));
}

TEST_F(JobQueueTest, EachTenantHasItsOwnLimit) {
  limits_["b"].queue = 3;
  Open({.workers = 0, .capacity = 2});
  PushMany(2, "a");
  EXPECT_EQ(queue_->RoomFor("a", 1), Room::kTenantFull);
  PushMany(2, "b");
  EXPECT_TRUE(HasRoom("b"));
  PushMany(1, "b");
  EXPECT_EQ(queue_->RoomFor("b", 1), Room::kTenantFull);
  EXPECT_EQ(queue_->Capacity("a"), 2);
  EXPECT_EQ(queue_->Capacity("b"), 3);
}

TEST_F(JobQueueTest, WhereAllIsFullATenantStillHasItsPart) {
  Open({.workers = 0, .capacity = 1000, .total = 12});
  PushMany(12, "a");
  EXPECT_EQ(queue_->RoomFor("a", 1), Room::kServerFull);
  PushMany(6, "b");
  EXPECT_EQ(queue_->RoomFor("b", 1), Room::kServerFull) << "half of 12";
  PushMany(4, "c");
  EXPECT_EQ(queue_->RoomFor("c", 1), Room::kServerFull) << "a third";
  EXPECT_EQ(queue_->size(), 12 + 6 + 4) << "12 (1 + 1/2 + 1/3)";
}

TEST_F(JobQueueTest, MoreTenantsThanPlacesHaveOneEach) {
  Open({.workers = 0, .capacity = 1000, .total = 2});
  for (const char* tenant : {"a", "b", "c", "d", "e"}) {
    EXPECT_TRUE(HasRoom(tenant));
    PushMany(1, tenant);
    EXPECT_EQ(HasRoom(tenant), queue_->size() < 2);
  }
}

// ---- whose turn it is

TEST_F(JobQueueTest, ATenantThatComesIsNextWhateverOthersHaveWaiting) {
  for (const int workers : {1, 4}) {
    Open({.workers = workers, .capacity = 2000, .total = 2000});
    PushMany(1000, "a");
    std::vector<std::string> running;
    for (int i = 0; i < workers; ++i) running.push_back(Start());
    // All along the way, and however wrong what was expected of a's jobs.
    for (const double takes : {1.0, 0.001, 30.0}) {
      Pass(takes);
      Push("b" + std::to_string(number_), "b");
      EXPECT_EQ(queue_->Position("b" + std::to_string(number_ - 1), now_), 0);
      queue_->End(running.back(), now_);
      running.back() = Start();
      EXPECT_EQ(running.back()[0], 'b') << workers << " workers, jobs of " << takes << " s";
      queue_->End(running.back(), now_);
      running.back() = Start();
      EXPECT_EQ(running.back()[0], 'a') << "b has nothing waiting";
    }
  }
}

TEST_F(JobQueueTest, SharesAreKeptOverALongRun) {
  limits_["a"].share = 2;
  Open({.capacity = 2000, .total = 10'000});
  PushMany(900, "a");
  PushMany(900, "b");
  std::map<char, int> served = Serve(600, OneSecond);
  EXPECT_NEAR(served['a'], 400, 1);
  EXPECT_NEAR(served['b'], 200, 1);
}

TEST_F(JobQueueTest, SharesAreOfTimeNotOfJobs) {
  Open({.capacity = 2000, .total = 10'000});
  PushMany(1000, "a", 5);
  PushMany(1000, "b", 1);
  std::map<char, int> served = Serve(600, [](const std::string& name) { return name[0] == 'a' ? 5.0 : 1.0; });
  EXPECT_NEAR(served['a'], 100, 2);
  EXPECT_NEAR(served['b'], 500, 2);
}

TEST_F(JobQueueTest, WhatJobsReallyTakeCountsNotWhatWasExpected) {
  Open({.capacity = 2000, .total = 10'000});
  PushMany(1000, "a", 0.01);
  PushMany(1000, "b", 50);
  std::map<char, int> served = Serve(600, [](const std::string& name) { return name[0] == 'a' ? 5.0 : 1.0; });
  EXPECT_NEAR(served['a'], 100, 2);
  EXPECT_NEAR(served['b'], 500, 2);
}

TEST_F(JobQueueTest, AbsenceEarnsNothing) {
  Open({.capacity = 2000, .total = 10'000});
  PushMany(1000, "a");
  Serve(200, OneSecond);
  PushMany(1000, "b");
  std::map<char, int> served = Serve(20, OneSecond);
  EXPECT_NEAR(served['b'], 10, 1) << "200 s that it did not want are no debt to it";
}

TEST_F(JobQueueTest, WhatWasTakenWhileOthersWaitedIsRemembered) {
  Open({.capacity = 2000, .total = 10'000});
  PushMany(100, "a", 1);
  Push("b long", "b", 10);
  EXPECT_EQ(Start()[0], 'a');
  Pass(1);
  queue_->End("a1", now_);
  EXPECT_EQ(Start(), "b long");
  Pass(10);
  queue_->End("b long", now_);
  Push("b again", "b", 1);
  EXPECT_THAT(Serve(8, OneSecond), ElementsAre(std::pair('a', 8))) << "b had 10 s, a had 1";
  std::map<char, int> later = Serve(4, OneSecond);
  EXPECT_EQ(later['b'], 1);
}

TEST_F(JobQueueTest, AnIdleServerForgetsWhoHadWhat) {
  Open({.capacity = 2000, .total = 10'000});
  PushMany(50, "a");
  Serve(50, OneSecond);
  EXPECT_EQ(queue_->running(), 0);
  PushMany(4, "b");
  PushMany(4, "a");
  std::map<char, int> served = Serve(4, OneSecond);
  EXPECT_EQ(served['a'], 2);
}

TEST_F(JobQueueTest, ATenantRunsNoMoreThanItMay) {
  limits_["a"].running = 2;
  Open({.workers = 4});
  PushMany(5, "a");
  EXPECT_EQ(Start(), "a1");
  EXPECT_EQ(Start(), "a2");
  EXPECT_EQ(queue_->Front(now_), std::nullopt);
  Push("b", "b");
  EXPECT_EQ(Start(), "b");
  queue_->End("a1", now_);
  EXPECT_EQ(Start(), "a3");
  EXPECT_EQ(queue_->running("a"), 2);
  limits_["a"].running = -1;
  EXPECT_EQ(Start(), "a4") << "limits are those of now";
}

TEST_F(JobQueueTest, WhatALimitKeepsATenantFromIsNoCredit) {
  limits_["c"].running = 1;
  Open({.workers = 4, .capacity = 2000, .total = 10'000});
  PushMany(500, "a");
  PushMany(500, "c");
  std::vector<std::string> running;
  for (int i = 0; i < 4; ++i) running.push_back(Start());
  for (int round = 0; round < 50; ++round) {
    Pass(1);
    for (std::string& job : running) queue_->End(job, now_);
    for (std::string& job : running) job = Start();
  }
  EXPECT_EQ(queue_->running("c"), 1);
  limits_["c"].running = -1;
  std::map<char, int> served;
  for (int round = 0; round < 10; ++round) {
    Pass(1);
    for (std::string& job : running) queue_->End(job, now_);
    for (std::string& job : running) ++served[(job = Start())[0]];
  }
  EXPECT_NEAR(served['a'], 20, 4);
  EXPECT_NEAR(served['c'], 20, 4);
}

// ---- what is said of it

TEST_F(JobQueueTest, PositionsAreTheOrderThatIsUsed) {
  limits_["b"].share = 3;
  Open({.capacity = 2000, .total = 10'000});
  for (int i = 0; i < 20; ++i) {
    Push("a" + std::to_string(i), "a", 1 + i % 3);
    Push("b" + std::to_string(i), "b", 2);
    Push("c" + std::to_string(i), "c", 0.5);
  }
  std::map<std::string, int> positions;
  std::map<std::string, double> expected;
  for (int i = 0; i < 20; ++i) {
    for (const char* tenant : {"a", "b", "c"}) {
      const std::string name = tenant + std::to_string(i);
      positions[name] = queue_->Position(name, now_);
      expected[name] = tenant[0] == 'a' ? 1 + i % 3 : tenant[0] == 'b' ? 2 : 0.5;
    }
  }
  for (int i = 0; i < 60; ++i) {
    const std::string name = Start();
    EXPECT_EQ(positions[name], i) << name;
    Pass(expected[name]);
    queue_->End(name, now_);
  }
}

TEST_F(JobQueueTest, SecondsUntilTurn) {
  Open({.workers = 1, .capacity = 2000, .total = 10'000});
  EXPECT_EQ(queue_->SecondsUntilTurn("a", now_), 0);
  PushMany(11, "a", 2);
  Start();
  Pass(0.5);
  EXPECT_NEAR(queue_->SecondsUntilTurn("a", now_), 1.5 + 10 * 2, 1e-9);
  EXPECT_NEAR(queue_->SecondsUntilTurn("b", now_), 1.5, 1e-9) << "it will be next";
  queue_->SetSecondsFactor(10);
  EXPECT_NEAR(queue_->SecondsUntilTurn("a", now_), 19.5 + 10 * 20, 1e-9);
}

TEST_F(JobQueueTest, SecondsUntilTurnWithALimitOfRunningJobs) {
  limits_["a"].running = 1;
  Open({.workers = 4, .capacity = 2000, .total = 10'000});
  PushMany(3, "a", 2);
  Start();
  EXPECT_NEAR(queue_->SecondsUntilTurn("a", now_), 6, 1e-9);
  EXPECT_EQ(queue_->SecondsUntilTurn("b", now_), 0);
}

TEST_F(JobQueueTest, SecondsUntilRoom) {
  Open({.workers = 1, .capacity = 1, .total = 10'000});
  EXPECT_EQ(queue_->SecondsUntilRoom("a", Room::kTenantFull, now_), std::nullopt);
  Push("a1", "a", 8);
  Start();
  Push("b1", "b", 3);
  Push("a2", "a", 1);
  ASSERT_EQ(queue_->RoomFor("a", 1), Room::kTenantFull);
  Pass(2);
  EXPECT_NEAR(*queue_->SecondsUntilRoom("a", Room::kTenantFull, now_), 6 + 3, 1e-9) << "b1 is ahead of a2";
  EXPECT_NEAR(*queue_->SecondsUntilRoom("b", Room::kTenantFull, now_), 6, 1e-9);
}

}  // namespace
}  // namespace planish
