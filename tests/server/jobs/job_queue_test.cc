#include "server/jobs/job_queue.h"

#include "gtest/gtest.h"

namespace planish {
namespace {

const absl::Time kNow = absl::FromUnixSeconds(1'000'000);

void Push(JobQueue* queue, const std::string& name, std::int64_t bytes = 1) {
  static std::int64_t number = 0;
  queue->Push(name, bytes, kNow, ++number);
}

TEST(JobQueue, FirstInFirstOut) {
  JobQueue queue(10, 1000);
  EXPECT_FALSE(queue.Front().has_value());
  Push(&queue, "a");
  Push(&queue, "b");
  Push(&queue, "c");
  EXPECT_EQ(queue.Position("a"), 0);
  EXPECT_EQ(queue.Position("c"), 2);
  queue.Remove("b");
  queue.Remove("unknown");
  EXPECT_EQ(queue.Position("c"), 1);
  EXPECT_EQ(queue.Front(), "a");
  queue.Remove("a");
  EXPECT_EQ(queue.Front(), "c");
  queue.Remove("c");
  EXPECT_TRUE(queue.empty());
}

TEST(JobQueue, PriorityCountsAsTimeWaited) {
  JobQueue queue(10, 1000);
  const auto push = [&](const std::string& name, absl::Duration later, v1::Priority priority) {
    queue.Push(name, 1, QueueTime(kNow + later, priority), queue.size());
  };
  push("low", absl::ZeroDuration(), v1::PRIORITY_LOW);
  push("normal", absl::Minutes(1), v1::PRIORITY_UNSPECIFIED);
  push("high", absl::Minutes(2), v1::PRIORITY_HIGH);
  push("late high", absl::Minutes(30), v1::PRIORITY_HIGH);
  EXPECT_EQ(queue.Position("high"), 0);
  EXPECT_EQ(queue.Position("normal"), 1);
  EXPECT_EQ(queue.Position("low"), 2) << "waited long enough to be ahead of what came half an hour later";
  EXPECT_EQ(queue.Position("late high"), 3);
}

TEST(JobQueue, ANameIsThereOnce) {
  JobQueue queue(10, 1000);
  Push(&queue, "a", 10);
  Push(&queue, "b", 10);
  Push(&queue, "a", 10);
  EXPECT_EQ(queue.size(), 2);
  EXPECT_EQ(queue.Front(), "b");
  EXPECT_TRUE(queue.HasRoom(980, 0));
  EXPECT_FALSE(queue.HasRoom(981, 0));
}

TEST(JobQueue, RoomCountsJobsAndIdleWorkers) {
  JobQueue queue(1, 1000);
  EXPECT_TRUE(queue.HasRoom(1, 0));
  Push(&queue, "a");
  EXPECT_FALSE(queue.HasRoom(1, 0));
  EXPECT_TRUE(queue.HasRoom(1, 1));
}

TEST(JobQueue, NoPlacesMeansOnlyForIdleWorkers) {
  const JobQueue queue(0, 1000);
  EXPECT_FALSE(queue.HasRoom(1, 0));
  EXPECT_TRUE(queue.HasRoom(1, 1));
}

TEST(JobQueue, RoomCountsBytes) {
  JobQueue queue(10, 100);
  EXPECT_TRUE(queue.HasRoom(5000, 0)) << "an empty queue takes any mesh";
  Push(&queue, "a", 60);
  EXPECT_TRUE(queue.HasRoom(40, 0));
  EXPECT_FALSE(queue.HasRoom(41, 0));
  Push(&queue, "b", 40);
  queue.Remove("a");
  EXPECT_TRUE(queue.HasRoom(60, 0));
  queue.Remove("b");
  EXPECT_TRUE(queue.HasRoom(100, 0));
}

}  // namespace
}  // namespace planish
