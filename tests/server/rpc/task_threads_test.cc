#include "server/rpc/task_threads.h"

#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

using ::testing::ElementsAre;

TEST(TaskThreads, TenantsTakeTurns) {
  std::vector<std::string> begun;
  std::promise<void> all_posted;
  {
    TaskThreads threads(1);
    threads.Post("ann", [wait = all_posted.get_future().share()] { wait.wait(); });
    for (const std::string tenant : {"ann", "ann", "ann", "bob", "cid", "bob"}) {
      threads.Post(tenant, [&begun, tenant] { begun.push_back(tenant); });
    }
    all_posted.set_value();
  }  // runs what is left
  EXPECT_THAT(begun, ElementsAre("bob", "cid", "ann", "bob", "ann", "ann"));
}

TEST(TaskThreads, NoTenantHasAllOfThem) {
  TaskThreads threads(3);
  std::promise<void> end;
  const std::shared_future<void> wait = end.get_future().share();
  for (int i = 0; i < 10; ++i) threads.Post("ann", [wait] { wait.wait(); });
  std::promise<void> ran;
  threads.Post("bob", [&ran] { ran.set_value(); });
  EXPECT_EQ(ran.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  end.set_value();
}

TEST(TaskThreads, ATaskMayPostTheNextOne) {
  int runs = 0;
  {
    TaskThreads threads(2);
    std::promise<void> done;
    std::function<void()> step = [&] {
      if (++runs == 1000) return done.set_value();
      threads.Post("ann", step);
    };
    threads.Post("ann", step);
    done.get_future().wait();
  }
  EXPECT_EQ(runs, 1000);
}

}  // namespace
}  // namespace planish
