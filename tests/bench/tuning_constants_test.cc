#include "tests/bench/tuning_constants.h"

#include <set>
#include <string>

#include "gtest/gtest.h"

namespace planish::bench {
namespace {

// A constant that is added to FlattenTuning but not to the list would never be swept. All members have eight bytes, so
// that the addresses of a complete list leave no gap.
TEST(TuningConstants, AreAllOfThem) {
  FlattenTuning tuning;
  std::set<const void*> addresses;
  std::set<std::string> names;
  for (const TuningConstant& constant : ConstantsOf(&tuning)) {
    names.insert(constant.name);
    addresses.insert(std::visit([](const auto* number) -> const void* { return number; }, constant.number));
  }
  EXPECT_EQ(names.size(), addresses.size());
  EXPECT_EQ(8 * addresses.size(), sizeof tuning);
}

TEST(TuningConstants, AreHalvedAndDoubledOnTheirOwnScale) {
  FlattenTuning tuning;
  const auto after = [&](const std::string& name, double factor) {
    for (const TuningConstant& constant : ConstantsOf(&tuning)) {
      if (constant.name != name) continue;
      constant.Multiply(factor);
      return constant.Value();
    }
    ADD_FAILURE() << name;
    return 0.0;
  };
  tuning.newton.forcing.max_error = 0.01;
  EXPECT_DOUBLE_EQ(after("newton.forcing.max_error", 2), 0.02);
  tuning.newton.line_search.fraction_to_boundary = 0.95;
  EXPECT_DOUBLE_EQ(after("newton.line_search.fraction_to_boundary", 2), 0.9);
  tuning.newton.line_search.penalty_factor = 1.5;
  EXPECT_DOUBLE_EQ(after("newton.line_search.penalty_factor", 2), 2);
  tuning.newton.barrier.short_steps = 1;
  EXPECT_EQ(after("newton.barrier.short_steps", 0.5), 1) << "a count of zero would be another method";
}

}  // namespace
}  // namespace planish::bench
