#include "server/jobs/event_log.h"

#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

v1::JobEvent StateEvent(v1::JobState state) {
  v1::JobEvent event;
  event.mutable_job()->set_state(state);
  return event;
}

v1::JobEvent IterationEvent(int i) {
  v1::JobEvent event;
  event.mutable_progress()->set_newton_iteration(i);
  return event;
}

// With the next sequence.
void Add(JobEventLog* log, v1::JobEvent event, StoredBlobPtr uv = nullptr) {
  event.set_sequence(log->last_sequence() + 1);
  EXPECT_TRUE(log->Append(std::move(event), std::move(uv)));
}

// Everything there is to read after `after`.
std::vector<v1::JobEvent> ReadAll(const JobEventLog& log, std::int64_t after) {
  std::vector<v1::JobEvent> events;
  while (auto event = log.ReadAfter(after).event) {
    after = event->sequence();
    events.push_back(*event);
  }
  return events;
}

std::vector<std::int64_t> Sequences(const std::vector<v1::JobEvent>& events) {
  std::vector<std::int64_t> sequences;
  for (const auto& event : events) sequences.push_back(event.sequence());
  return sequences;
}

std::vector<std::int64_t> Skipped(const std::vector<v1::JobEvent>& events) {
  std::vector<std::int64_t> skipped;
  for (const auto& event : events) skipped.push_back(event.skipped());
  return skipped;
}

TEST(EventLog, HasWhatWasAppended) {
  JobEventLog log(8);
  EXPECT_FALSE(log.ReadAfter(0).event.has_value());
  EXPECT_FALSE(log.ReadAfter(0).ended);
  Add(&log, StateEvent(v1::JOB_STATE_QUEUED));
  Add(&log, StateEvent(v1::JOB_STATE_RUNNING));
  Add(&log, IterationEvent(1));
  const auto events = ReadAll(log, 0);
  EXPECT_THAT(Sequences(events), ElementsAre(1, 2, 3));
  EXPECT_THAT(Skipped(events), ElementsAre(0, 0, 0));
  EXPECT_THAT(Sequences(ReadAll(log, 2)), ElementsAre(3));
  EXPECT_THAT(ReadAll(log, 3), IsEmpty());
}

TEST(EventLog, TakesEventsInTheirOrderAndOnce) {
  JobEventLog log(8);
  v1::JobEvent event = IterationEvent(1);
  const auto append = [&](std::int64_t sequence) {
    event.set_sequence(sequence);
    return log.Append(event);
  };
  EXPECT_TRUE(append(1));
  EXPECT_FALSE(append(3)) << "2 is missing";
  EXPECT_TRUE(append(1)) << "it is there";
  EXPECT_TRUE(append(2));
  EXPECT_TRUE(append(3));
  event.set_sequence(1000);
  log.Restore(event);
  event.set_sequence(3);
  log.Restore(event);
  EXPECT_THAT(Sequences(ReadAll(log, 0)), ElementsAre(1, 2, 3, 1000));
  EXPECT_EQ(ReadAll(log, 3)[0].skipped(), 996) << "where the store has a jump";
}

TEST(EventLog, DropsOldProgressNeverStates) {
  JobEventLog log(4);
  Add(&log, StateEvent(v1::JOB_STATE_QUEUED));
  Add(&log, StateEvent(v1::JOB_STATE_RUNNING));
  for (int i = 1; i <= 10; ++i) Add(&log, IterationEvent(i));
  Add(&log, StateEvent(v1::JOB_STATE_STOPPING));
  Add(&log, StateEvent(v1::JOB_STATE_CANCELLED));

  auto events = ReadAll(log, 0);
  EXPECT_THAT(Sequences(events), ElementsAre(1, 2, 13, 14));
  EXPECT_THAT(Skipped(events), ElementsAre(0, 0, 10, 0));
  events = ReadAll(log, 7);
  EXPECT_THAT(Sequences(events), ElementsAre(13, 14));
  EXPECT_THAT(Skipped(events), ElementsAre(5, 0));
}

TEST(EventLog, LateReaderSeesTheNewestProgress) {
  JobEventLog log(3);
  Add(&log, StateEvent(v1::JOB_STATE_QUEUED));
  for (int i = 1; i <= 100; ++i) Add(&log, IterationEvent(i));
  const auto events = ReadAll(log, 0);
  ASSERT_EQ(events.size(), 3u);
  EXPECT_THAT(Sequences(events), ElementsAre(1, 100, 101));
  EXPECT_EQ(events.back().progress().newton_iteration(), 100);
}

TEST(EventLog, StatesAloneMayExceedTheCapacity) {
  JobEventLog log(1);
  for (int i = 0; i < 4; ++i) Add(&log, StateEvent(v1::JOB_STATE_QUEUED));
  EXPECT_THAT(Sequences(ReadAll(log, 0)), ElementsAre(1, 2, 3, 4));
}

TEST(EventLog, EndsOnceWithTheUv) {
  JobEventLog log(8);
  EXPECT_EQ(log.uv(), nullptr);
  Add(&log, StateEvent(v1::JOB_STATE_SUCCEEDED), StoredBlob::InMemory(*Blob::Copy("uv")));
  Add(&log, IterationEvent(1));
  Add(&log, StateEvent(v1::JOB_STATE_FAILED));
  EXPECT_THAT(Sequences(ReadAll(log, 0)), ElementsAre(1));
  EXPECT_FALSE(log.ReadAfter(0).ended);
  EXPECT_TRUE(log.ReadAfter(1).ended);
  EXPECT_TRUE(log.ReadAfter(99).ended);
  ASSERT_NE(log.uv(), nullptr);
  EXPECT_EQ(log.uv()->ReadAll().value(), "uv");
}

TEST(EventLog, WakesSubscribersUntilTheyDrop) {
  JobEventLog log(8);
  int first = 0;
  int second = 0;
  auto subscription = log.Subscribe([&] { ++first; });
  const auto other = log.Subscribe([&] { ++second; });
  Add(&log, IterationEvent(1));
  EXPECT_EQ(first, 0);
  log.Notify();
  subscription.reset();
  log.Notify();
  EXPECT_EQ(first, 1);
  EXPECT_EQ(second, 2);
}

TEST(EventLog, SubscriberMayUseTheLogFromItsCallback) {
  JobEventLog log(8);
  std::vector<std::int64_t> seen;
  std::int64_t after = 0;
  JobEventLog::Subscription inner;
  const auto subscription = log.Subscribe([&] {
    while (auto event = log.ReadAfter(after).event) seen.push_back(after = event->sequence());
    inner = log.Subscribe([] {});
  });
  Add(&log, IterationEvent(1));
  Add(&log, IterationEvent(2));
  log.Notify();
  EXPECT_THAT(seen, ElementsAre(1, 2));
}

TEST(EventLog, ReadersOnOtherThreadsSeeEverySequenceInOrder) {
  constexpr int kEvents = 2000;
  JobEventLog log(kEvents + 1);
  std::vector<std::thread> readers;
  for (int r = 0; r < 3; ++r) {
    readers.emplace_back([&log, last = std::int64_t{kEvents}] {
      std::int64_t after = 0;
      while (true) {
        const JobEventLog::Read read = log.ReadAfter(after);
        if (read.ended) break;
        if (!read.event.has_value()) continue;
        EXPECT_EQ(read.event->sequence(), after + 1);
        EXPECT_EQ(read.event->skipped(), 0);
        after = read.event->sequence();
      }
      EXPECT_EQ(after, last);
    });
  }
  for (int i = 1; i < kEvents; ++i) Add(&log, IterationEvent(i));
  Add(&log, StateEvent(v1::JOB_STATE_SUCCEEDED));
  for (auto& reader : readers) reader.join();
}

}  // namespace
}  // namespace planish
