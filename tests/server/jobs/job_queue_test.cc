#include "server/jobs/job_queue.h"

#include "gtest/gtest.h"

namespace planish {
namespace {

TEST(JobQueue, FirstInFirstOut) {
  JobQueue queue(10, 1000);
  EXPECT_FALSE(queue.Pop().has_value());
  queue.Push("a", 1);
  queue.Push("b", 1);
  queue.Push("c", 1);
  EXPECT_EQ(queue.Position("a"), 0);
  EXPECT_EQ(queue.Position("c"), 2);
  queue.Remove("b");
  queue.Remove("unknown");
  EXPECT_EQ(queue.Position("c"), 1);
  EXPECT_EQ(queue.Pop(), "a");
  EXPECT_EQ(queue.Pop(), "c");
  EXPECT_TRUE(queue.empty());
}

TEST(JobQueue, RoomCountsJobsAndIdleWorkers) {
  JobQueue queue(1, 1000);
  EXPECT_TRUE(queue.HasRoom(1, 0));
  queue.Push("a", 1);
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
  queue.Push("a", 60);
  EXPECT_TRUE(queue.HasRoom(40, 0));
  EXPECT_FALSE(queue.HasRoom(41, 0));
  queue.Push("b", 40);
  queue.Remove("a");
  EXPECT_TRUE(queue.HasRoom(60, 0));
  queue.Pop();
  EXPECT_TRUE(queue.HasRoom(100, 0));
}

}  // namespace
}  // namespace planish
