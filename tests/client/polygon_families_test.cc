// Polygon meshes of many families, judged by the bytes that are written. planish_polygon_hunt (tests/bench) tries as many
// as there is time for.
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/client/polygon_promises.h"
#include "tests/testing/polygon_families.h"

namespace planish {
namespace {

using ::testing::IsEmpty;
using ::testing::ValuesIn;

class PolygonFamily : public ::testing::TestWithParam<std::string> {};

TEST_P(PolygonFamily, IsWrittenWhole) {
  const MeshFormat formats[] = {MeshFormat::kObj, MeshFormat::kPly, MeshFormat::kOff, MeshFormat::kGlb, MeshFormat::kDraco};
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    const int size = seed % 3 == 0 ? 60 : 3 + static_cast<int>(seed);
    const std::string obj = testing::ObjText(testing::MakePolygons(GetParam(), seed, size));
    EXPECT_THAT(testing::BrokenPolygonPromises(obj, formats[seed % 5]), IsEmpty()) << "seed " << seed << ", size " << size;
  }
}

INSTANTIATE_TEST_SUITE_P(All, PolygonFamily, ValuesIn(testing::PolygonFamilies()),
                         [](const auto& family) { return family.param; });

}  // namespace
}  // namespace planish
