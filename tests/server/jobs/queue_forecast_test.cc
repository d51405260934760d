#include "server/jobs/queue_forecast.h"

#include <map>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

// What is said of a queue is compared with what the store then does.
class QueueForecastTest : public ::testing::Test {
 protected:
  QueueForecastTest() {
    JobStoreOptions options;
    options.clock = [this] { return now_; };
    store_ = std::make_unique<JobStore>(*OpenSqliteDatabase(":memory:"), options);
  }

  // The tenant is the first letter.
  void Push(const std::string& name, double seconds = 1) {
    NewJob job;
    v1::Job* described = job.record.mutable_job();
    described->set_name(name);
    described->set_state(v1::JOB_STATE_QUEUED);
    described->set_tenant(name.substr(0, 1));
    *described->mutable_create_time() = ToTimestamp(absl::FromUnixSeconds(1000));
    job.record.set_work_key(name);
    job.run_time = absl::Seconds(seconds);
    ASSERT_TRUE(store_->Accept(context_, job)->created);
  }

  // The name of what is claimed.
  std::string Start() {
    ClaimRequest request = {"owner", absl::Hours(1), 1, 0, ""};
    request.tenant_limits = Limits();
    const std::vector<ClaimedWork> claimed = *store_->Claim(context_, request);
    if (claimed.empty()) return "";
    lease_ = claimed[0].lease;
    return lease_.work;
  }
  void End() { ASSERT_TRUE(store_->Finish(context_, lease_, AttemptOutcome()).ok()); }
  void Pass(double seconds) { now_ += absl::Seconds(seconds); }

  TenantLimitsSource Limits() {
    return [this](const std::string& tenant) { return limits_[tenant]; };
  }
  QueueForecast Forecast(int workers = 1, double factor = 1) {
    return QueueForecast(*store_->Queue(), Limits(), workers, factor);
  }

  absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  VerbContext context_;
  std::map<std::string, TenantLimits> limits_;
  std::unique_ptr<JobStore> store_;
  Lease lease_;
};

TEST_F(QueueForecastTest, PositionsAreTheOrderThatIsUsed) {
  limits_["b"].share = 3;
  std::map<std::string, double> seconds;
  for (int i = 0; i < 20; ++i) {
    seconds["a" + std::to_string(i)] = 1 + i % 3;
    seconds["b" + std::to_string(i)] = 2;
    seconds["c" + std::to_string(i)] = 0.5;
    for (const char* tenant : {"a", "b", "c"}) {
      const std::string name = tenant + std::to_string(i);
      Push(name, seconds[name]);
    }
  }
  std::map<std::string, int> positions;
  const QueueForecast forecast = Forecast();
  for (const auto& [name, each] : seconds) positions[name] = forecast.Position(name);
  for (int i = 0; i < 60; ++i) {
    const std::string name = Start();
    EXPECT_EQ(positions[name], i) << name;
    Pass(seconds[name]);
    End();
  }
  EXPECT_EQ(Forecast().Position("a0"), 0) << "it is gone";
}

TEST_F(QueueForecastTest, SecondsUntilTurn) {
  EXPECT_EQ(Forecast().SecondsUntilTurn("a"), 0);
  for (int i = 0; i < 11; ++i) Push("a" + std::to_string(i), 2);
  Start();
  Pass(0.5);
  EXPECT_NEAR(Forecast().SecondsUntilTurn("a"), 1.5 + 10 * 2, 1e-9);
  EXPECT_NEAR(Forecast().SecondsUntilTurn("b"), 1.5, 1e-9) << "it will be next";
  EXPECT_NEAR(Forecast(1, 10).SecondsUntilTurn("a"), 19.5 + 10 * 20, 1e-9);
}

TEST_F(QueueForecastTest, SecondsUntilTurnWithALimitOfRunningJobs) {
  limits_["a"].running = 1;
  for (int i = 0; i < 3; ++i) Push("a" + std::to_string(i), 2);
  Start();
  EXPECT_NEAR(Forecast(4).SecondsUntilTurn("a"), 6, 1e-9);
  EXPECT_EQ(Forecast(4).SecondsUntilTurn("b"), 0);
}

TEST_F(QueueForecastTest, SecondsUntilRoom) {
  EXPECT_EQ(Forecast().SecondsUntilRoom("a", Room::kTenantFull), std::nullopt);
  Push("a1", 8);
  Start();
  Push("b1", 3);
  Push("a2", 1);
  Pass(2);
  EXPECT_NEAR(*Forecast().SecondsUntilRoom("a", Room::kTenantFull), 6 + 3, 1e-9) << "b1 is ahead of a2";
  EXPECT_NEAR(*Forecast().SecondsUntilRoom("b", Room::kTenantFull), 6, 1e-9);
}

}  // namespace
}  // namespace planish
