#include "core/base/trace_context.h"

#include <set>

#include "gtest/gtest.h"

namespace planish {
namespace {

constexpr char kValid[] = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

TEST(TraceContext, ValidHeadersStay) {
  EXPECT_EQ(ParseTraceparent(kValid), kValid);
  EXPECT_EQ(TraceIdOf(kValid), "0af7651916cd43dd8448eb211c80319c");
  EXPECT_EQ(ParseTraceparent("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-00").size(), 55);
}

TEST(TraceContext, LaterVersionsAreReadAsThisOne) {
  const std::string later = "cc" + std::string(kValid).substr(2);
  EXPECT_EQ(ParseTraceparent(later), kValid);
  EXPECT_EQ(ParseTraceparent(later + "-what-comes"), kValid);
  EXPECT_EQ(ParseTraceparent(later + "."), "");
}

TEST(TraceContext, AnythingElseIsNone) {
  const std::string valid = kValid;
  for (const std::string& bad :
       {std::string(), std::string("00"), valid + "-", valid + "0", valid.substr(1), valid.substr(0, 54),
        "ff" + valid.substr(2), std::string("00-0AF7651916CD43DD8448EB211C80319C-b7ad6b7169203331-01"),
        std::string("00-00000000000000000000000000000000-b7ad6b7169203331-01"),
        std::string("00-0af7651916cd43dd8448eb211c80319c-0000000000000000-01"),
        std::string("00_0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"),
        std::string("00-0af7651916cd43dd8448eb211c80319g-b7ad6b7169203331-01"),
        std::string("0x-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"),
        std::string("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-0\n"), " " + valid.substr(1)}) {
    EXPECT_EQ(ParseTraceparent(bad), "") << bad;
    EXPECT_EQ(TraceIdOf(bad), "") << bad;
  }
  // Byte by byte: only hex digits may stand where they do.
  for (std::size_t i = 0; i < valid.size(); ++i) {
    std::string damaged = valid;
    damaged[i] = '/';
    EXPECT_EQ(ParseTraceparent(damaged), "") << damaged;
  }
}

TEST(TraceContext, NewOnesAreValidAndChildrenStayInTheTrace) {
  std::uint64_t bits = 0;  // zeros are skipped: no id may be all zeros
  const RandomBits count = [&bits] { return bits++; };
  const std::string trace = NewTraceparent(count);
  EXPECT_EQ(trace, "00-00000000000000010000000000000002-0000000000000003-01");
  EXPECT_EQ(ParseTraceparent(trace), trace);
  const std::string child = ChildTraceparent(kValid, count);
  EXPECT_EQ(child, "00-0af7651916cd43dd8448eb211c80319c-0000000000000004-01");
}

}  // namespace
}  // namespace planish
