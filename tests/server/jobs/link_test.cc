#include <stdexcept>

#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/link/in_process_link.h"
#include "server/link/rpc_status.h"
#include "tests/server/testing/fake_workers.h"

namespace planish {
namespace {

using worker::v1::ToWorker;

TEST(InProcessLink, DeliversWhatWasSentBeforeTheWorkerHungUp) {
  const auto link = StartInProcessWorker([](ServerLink& server) {
    server.Send(ProgressMessage(1));
    server.Send(SuccessMessage("uv"));
    server.Close();
    server.Send(ProgressMessage(2));
  });
  ASSERT_TRUE(link.ok());
  EXPECT_TRUE((*link)->Receive()->has_event());
  EXPECT_TRUE((*link)->Receive()->has_result());
  EXPECT_FALSE((*link)->Receive().has_value());
}

TEST(InProcessLink, WorkerThatThrowsClosesTheLink) {
  const auto link = StartInProcessWorker([](ServerLink&) { throw std::runtime_error("boom"); });
  ASSERT_TRUE(link.ok());
  EXPECT_FALSE((*link)->Receive().has_value());
}

TEST(InProcessLink, DestructionEndsAWorkerThatWaits) {
  bool saw_the_end = false;
  {
    const auto link = StartInProcessWorker([&](ServerLink& server) {
      while (server.Receive().has_value()) {
      }
      saw_the_end = true;
    });
    ASSERT_TRUE(link.ok());
    (*link)->Send(ToWorker());
  }
  EXPECT_TRUE(saw_the_end);
}

TEST(RpcStatus, CarriesReasonMetadataAndRetry) {
  const absl::Status status =
      WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL", "full", {{"queue_capacity", "3"}}),
                     absl::Milliseconds(1500));
  const google::rpc::Status rpc = ToRpcStatus(status);
  EXPECT_EQ(rpc.code(), 8);
  EXPECT_EQ(rpc.message(), "full");
  ASSERT_EQ(rpc.details_size(), 2);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(rpc.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "QUEUE_FULL");
  EXPECT_EQ(info.domain(), "planish");
  EXPECT_EQ(info.metadata().at("queue_capacity"), "3");
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(rpc.details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 1);
  EXPECT_EQ(retry.retry_delay().nanos(), 500'000'000);
}

TEST(RpcStatus, OkIsEmptyAndForeignErrorsGetTheirCodeAsReason) {
  EXPECT_EQ(ToRpcStatus(absl::OkStatus()).ByteSizeLong(), 0u);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(ToRpcStatus(absl::AbortedError("x")).details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "ABORTED");
}

TEST(RpcStatus, BrokenUtf8InAMessageStaysReadable) {
  const google::rpc::Status rpc = ToRpcStatus(absl::InternalError("bad \xff byte"));
  google::rpc::Status parsed;
  ASSERT_TRUE(parsed.ParseFromString(rpc.SerializeAsString()));
  EXPECT_EQ(parsed.message(), "bad \xEF\xBF\xBD byte");
}

}  // namespace
}  // namespace planish
