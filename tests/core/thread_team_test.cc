#include "core/base/thread_team.h"

#include <cmath>
#include <vector>

#include "gtest/gtest.h"

namespace planish {
namespace {

TEST(ThreadTeam, EveryChunkRunsOnce) {
  for (const int size : {1, 2, 3, 5}) {
    ThreadTeam team(size);
    EXPECT_EQ(team.size(), size);
    std::vector<int> visits(1001, 0);
    for (int loop = 1; loop <= 2000; ++loop) {
      team.For(1001, 7, [&](std::int64_t begin, std::int64_t end) {
        ASSERT_LE(end - begin, 7);
        for (std::int64_t i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
      });
      ASSERT_EQ(visits, std::vector<int>(1001, loop)) << size << " threads";
    }
  }
}

TEST(ThreadTeam, ATaskRunsBesideTheChunks) {
  for (const int size : {1, 2, 3}) {
    ThreadTeam team(size);
    for (const std::int64_t n : {0, 5, 100}) {
      std::vector<int> visits(static_cast<std::size_t>(n), 0);
      int tasks = 0;
      team.ForBeside([&] { ++tasks; }, n, 7,
                     [&](std::int64_t begin, std::int64_t end) {
                       ASSERT_LE(end - begin, 7);
                       for (std::int64_t i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
                     });
      EXPECT_EQ(tasks, 1);
      EXPECT_EQ(visits, std::vector<int>(static_cast<std::size_t>(n), 1));
    }
  }
}

TEST(ThreadTeam, NothingToDo) {
  ThreadTeam team(2);
  team.For(0, 10, [](std::int64_t, std::int64_t) { FAIL(); });
  EXPECT_EQ(team.Sum(0, 10, [](std::int64_t, std::int64_t) { return 1.0; }), 0);
}

TEST(ThreadTeam, SumsAreTheSameBitsWithAnyTeam) {
  const auto sum = [](int size) {
    ThreadTeam team(size);
    return team.Sum(100000, 64, [](std::int64_t begin, std::int64_t end) {
      double part = 0;
      for (std::int64_t i = begin; i < end; ++i) part += std::sin(static_cast<double>(i));
      return part;
    });
  };
  const double alone = sum(1);
  for (const int size : {2, 3, 7}) EXPECT_EQ(sum(size), alone) << size << " threads";
}

}  // namespace
}  // namespace planish
