#include "server/metrics/definitions.h"

#include <regex>
#include <set>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

// https://prometheus.io/docs/practices/naming/
TEST(Definitions, NamesFollowPrometheus) {
  const std::regex name(R"(planish_[a-z]+(_[a-z0-9]+)*)");
  std::set<std::string> names;
  for (const MetricDefinition* metric : AllMetrics()) {
    const std::string text = metric->name;
    SCOPED_TRACE(text);
    EXPECT_TRUE(std::regex_match(text, name));
    EXPECT_TRUE(names.insert(text).second) << "twice";
    EXPECT_EQ(text.ends_with("_total"), metric->kind == MetricKind::kCounter);
    // Base units, in their place.
    EXPECT_FALSE(std::regex_search(text, std::regex("_(ms|millis|minutes|hours|kb|mb|mib|percent|count)(_|$)")));
    EXPECT_TRUE(std::string(metric->help).ends_with(".") &&
                std::isupper(metric->help[0]) + std::isdigit(metric->help[0]))
        << metric->help;
    EXPECT_EQ(metric->buckets.empty(), metric->kind != MetricKind::kHistogram);
    EXPECT_TRUE(std::is_sorted(metric->buckets.begin(), metric->buckets.end()));
  }
}

TEST(Definitions, TableInReadmeIsTheHeaders) {
  EXPECT_THAT(ReadFile(PLANISH_SOURCE_TREE "/server/metrics/README.md"), HasSubstr(MetricsTable()))
      << "server/metrics/README.md needs this table:\n"
      << MetricsTable();
}

}  // namespace
}  // namespace planish
