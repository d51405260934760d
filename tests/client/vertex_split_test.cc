#include "planish/vertex_split.h"

#include "gtest/gtest.h"
#include "planish/error.h"

namespace planish {
namespace {

// A square of two triangles; vertex 4 has none.
constexpr std::uint32_t kSquare[] = {0, 1, 2, 0, 2, 3};

Uv FloatUv(std::vector<float> values) {
  return Uv(std::move(values));
}

TEST(VertexSplit, KeepsVerticesWhereUvAgree) {
  const VertexSplit split = SplitVertices(5, kSquare, FloatUv({0, 0, 1, 0, 1, 1, -0.0f, 0, 1, 1, 0, 1}));
  EXPECT_EQ(split.source_vertex, (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(split.triangles, std::vector<std::uint32_t>(std::begin(kSquare), std::end(kSquare)));
  EXPECT_EQ(split.uv.As<float>(), (std::vector<float>{0, 0, 1, 0, 1, 1, 0, 1, 0, 0}));
}

TEST(VertexSplit, CopiesVerticesAtSeams) {
  const Uv uv(std::vector<double>{0, 0, 1, 0, 1, 1, 0, 0, 0.1, 0.2, 0, 1});
  const VertexSplit split = SplitVertices(5, kSquare, uv);
  EXPECT_EQ(split.source_vertex, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 2}));
  EXPECT_EQ(split.triangles, (std::vector<std::uint32_t>{0, 1, 2, 0, 5, 3}));
  EXPECT_EQ(std::get<std::vector<double>>(split.uv.numbers()),
            (std::vector<double>{0, 0, 1, 0, 1, 1, 0, 1, 0, 0, 0.1, 0.2}));
  EXPECT_EQ(split.vertex_count(), 6);
}

TEST(VertexSplit, RefusesWhatDoesNotFit) {
  const auto reason = [](std::int64_t vertices, const Uv& uv) {
    try {
      SplitVertices(vertices, kSquare, uv);
    } catch (const Error& error) {
      return error.reason();
    }
    return std::string();
  };
  EXPECT_EQ(reason(3, FloatUv(std::vector<float>(12))), "MESH_INDEX_OUT_OF_RANGE");
  EXPECT_EQ(reason(4, FloatUv(std::vector<float>(11))), "OPTIONS_INVALID");
  EXPECT_EQ(reason(-1, FloatUv(std::vector<float>(12))), "OPTIONS_INVALID");
}

}  // namespace
}  // namespace planish
