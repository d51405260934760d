#include "server/rpc/job_stream.h"

#include <memory>

#include "gtest/gtest.h"

namespace planish {
namespace {

v1::JobEvent Event(std::int64_t sequence, v1::JobState state) {
  v1::JobEvent event;
  event.set_sequence(sequence);
  event.mutable_job()->set_state(state);
  return event;
}

TEST(JobStream, TheEndIsToldToACallerWhoKnowsMoreThanTheDatabase) {
  const auto log = std::make_shared<JobEventLog>(10);
  log->Restore(Event(1, v1::JOB_STATE_RUNNING));
  JobStream stream(log, {.after_sequence = 7});
  v1::JobEvent event;
  v1::UvChunk chunk;
  EXPECT_EQ(stream.Next(&event, &chunk), JobStream::Step::kWait);
  EXPECT_FALSE(stream.job_ended());
  log->Restore(Event(2, v1::JOB_STATE_FAILED));
  EXPECT_EQ(stream.Next(&event, &chunk), JobStream::Step::kEvent);
  EXPECT_EQ(event.sequence(), 8);
  EXPECT_EQ(event.skipped(), 0);
  EXPECT_EQ(event.job().state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(stream.Next(&event, &chunk), JobStream::Step::kEnd);
  EXPECT_TRUE(stream.job_ended());
}

TEST(JobStream, TheEndIsToldOnce) {
  const auto log = std::make_shared<JobEventLog>(10);
  log->Restore(Event(1, v1::JOB_STATE_RUNNING));
  log->Restore(Event(2, v1::JOB_STATE_FAILED));
  JobStream stream(log, {.after_sequence = 2});
  v1::JobEvent event;
  v1::UvChunk chunk;
  EXPECT_EQ(stream.Next(&event, &chunk), JobStream::Step::kEnd);
}

TEST(JobStream, AJobThatGoesOnElsewhereHasNotEnded) {
  const auto log = std::make_shared<JobEventLog>(10);
  log->Restore(Event(1, v1::JOB_STATE_RUNNING));
  log->Interrupt(absl::UnavailableError("this server stops"));
  JobStream stream(log, {.after_sequence = 1});
  v1::JobEvent event;
  v1::UvChunk chunk;
  EXPECT_EQ(stream.Next(&event, &chunk), JobStream::Step::kEnd);
  EXPECT_FALSE(stream.job_ended());
}

class UvThatCannotBeRead : public StoredBlob {
 public:
  explicit UvThatCannotBeRead(const absl::Status& status) : StoredBlob(100), status_(status) {}

 private:
  absl::Status ReadRange(std::int64_t, std::int64_t, std::string*) const override { return status_; }

  const absl::Status status_;
};

TEST(JobStream, UvThatAreLostAreNotThoseOfAStoreThatIsAway) {
  const auto code = [](const absl::Status& status) {
    const auto log = std::make_shared<JobEventLog>(10);
    log->Restore(Event(1, v1::JOB_STATE_SUCCEEDED), std::make_shared<UvThatCannotBeRead>(status));
    JobStream stream(log, {.after_sequence = 1, .include_uv = true});
    v1::JobEvent event;
    v1::UvChunk chunk;
    EXPECT_EQ(stream.Next(&event, &chunk), JobStream::Step::kEnd);
    return stream.status().code();
  };
  EXPECT_EQ(code(absl::DataLossError("damaged")), absl::StatusCode::kNotFound);
  EXPECT_EQ(code(absl::UnavailableError("away")), absl::StatusCode::kUnavailable) << "the caller asks again";
}

}  // namespace
}  // namespace planish
