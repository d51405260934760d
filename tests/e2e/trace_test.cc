// W3C trace context from a command, or a program, to the server and back.
#include <memory>
#include <regex>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "planish/client.h"
#include "tests/e2e/command.h"
#include "tests/e2e/meshes.h"

namespace planish::testing {
namespace {

using nlohmann::json;

constexpr char kTraceId[] = "0af7651916cd43dd8448eb211c80319c";
const std::string kTraceparent = std::string("00-") + kTraceId + "-b7ad6b7169203331-01";

class TraceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { server_ = std::make_unique<PrivateServer>(ServerOptions(1)); }
  static void TearDownTestSuite() { server_.reset(); }
  TraceTest() {
    PutFile(grid_, GridObj(6));
    PutFile(closed_, kClosedObj);
  }

  // What `planish unwrap` reports.
  json Report(const std::string& mesh, const std::string& traceparent, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {
        "unwrap", mesh, "-o", directory_.Path("out.obj"), "--json", "--server=" + server_->target()};
    words.insert(words.end(), more.begin(), more.end());
    return json::parse(Planish(words, {{"TRACEPARENT", traceparent}}).out);
  }

  TempDir directory_;
  const std::string grid_ = directory_.Path("grid.obj"), closed_ = directory_.Path("closed.obj");
  static inline std::unique_ptr<PrivateServer> server_;
};

TEST_F(TraceTest, CommandsContinueTheEnvironments) {
  const json report = Report(grid_, kTraceparent);
  EXPECT_EQ(report["trace_id"], kTraceId);
  Client client(server_->target());
  EXPECT_EQ(client.GetJob(report["job"]).trace_id, kTraceId);
  const json failure = Report(closed_, kTraceparent, {"--seams=none"});
  EXPECT_EQ(failure["state"], "FAILED");
  EXPECT_EQ(failure["trace_id"], kTraceId);
}

TEST_F(TraceTest, WithoutAValidOneThereIsANewOne) {
  const std::regex id("[0-9a-f]{32}");
  const std::string first = Report(grid_, "")["trace_id"],
                    second = Report(grid_, "00-" + std::string(60, '0'))["trace_id"];
  EXPECT_TRUE(std::regex_match(first, id)) << first;
  EXPECT_TRUE(std::regex_match(second, id)) << second;
  EXPECT_NE(first, second);
}

TEST_F(TraceTest, ProgramsSayWhichOne) {
  Client client(server_->target());
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<std::uint32_t> triangles = {0, 1, 2};
  CallOptions call;
  call.traceparent = kTraceparent;
  EXPECT_EQ(client.Unwrap({positions, triangles}, {}, {}, call).trace_id, kTraceId);
  const Job job = client.CreateJob({positions, triangles}, {}, call);
  EXPECT_EQ(job.trace_id, kTraceId);
  EXPECT_EQ(client.AttachResult(job.name, {positions, triangles}).trace_id, kTraceId) << "the job's own";
  call.traceparent = "00-nonsense";
  try {
    client.Unwrap({positions, triangles}, {}, {}, call);
    FAIL() << "went through";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_EQ(error.reason(), "TRACEPARENT_INVALID");
  }
}

}  // namespace
}  // namespace planish::testing
