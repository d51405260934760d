// The memory of a batch: what killed runs leave behind.
#include <filesystem>
#include <thread>
#include <vector>

#include "client/cli/batch_plan.h"
#include "gtest/gtest.h"
#include "planish/error.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

class BatchStateTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& bytes, bool append = false) const {
    const std::string path = directory_ + "/" + name;
    PutFile(path, bytes, append);
    return path;
  }

  static BatchRecord Done(const std::string& key) {
    BatchRecord record;
    record.key = key;
    record.input = "1";
    record.settings = "2";
    record.version = "3";
    record.job = "jobs/4";
    record.usable = true;
    record.triangles = 5;
    record.charts = 6;
    record.seconds = 0.5;
    record.files = {{key, "7"}};
    return record;
  }

  const TempDir temporary_;
  const std::string directory_ = temporary_.Path();
};

TEST_F(BatchStateTest, RecordsGoThereAndBack) {
  BatchRecord record = Done("sub/a \"x\"\n.obj");
  record.usable = false;
  record.why = "1 triangle is flipped";
  const std::string line = ToLine(record);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const auto read = ParseRecord(line);
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->IsOf(record));
  EXPECT_EQ(ToLine(*read), line);
  for (std::size_t cut = 0; cut < line.size(); ++cut) EXPECT_FALSE(ParseRecord(line.substr(0, cut))) << cut;
  EXPECT_FALSE(ParseRecord("[]"));
  EXPECT_FALSE(ParseRecord(R"({"output":1,"state":"done"})"));

  BatchRecord other = record;
  other.input = "x";
  EXPECT_FALSE(other.IsOf(record));
  other = record;
  other.settings = "x";
  EXPECT_FALSE(other.IsOf(record));
  other = record;
  other.version = "x";
  EXPECT_FALSE(other.IsOf(record));
}

TEST_F(BatchStateTest, LastWordCounts) {
  BatchRecord queued = Done("a.obj");
  queued.queued = true;
  queued.server = "h:1";
  {
    BatchState state(directory_);
    EXPECT_FALSE(state.Find("a.obj"));
    state.Append(queued);
    EXPECT_TRUE(state.Find("a.obj")->queued);
  }
  {
    BatchState state(directory_ + "/");
    ASSERT_TRUE(state.Find("a.obj"));
    EXPECT_EQ(state.Find("a.obj")->server, "h:1");
    EXPECT_FALSE(state.IsIntact(queued));
    state.Append(Done("a.obj"));
  }
  EXPECT_FALSE(BatchState(directory_).Find("a.obj")->queued);
}

TEST_F(BatchStateTest, QuestionWithoutAnswer) {
  BatchRecord record = Done("a.obj");
  record.files.clear();
  record.server = "h:1";
  record.request_id = "r";
  const std::optional<BatchRecord> read = ParseRecord(ToLine(record));
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->IsOf(record));
  EXPECT_EQ(read->server, "h:1");
  EXPECT_EQ(read->request_id, "r");
  EXPECT_FALSE(read->queued);
}

TEST_F(BatchStateTest, TornLineIsNoLine) {
  {
    BatchState state(directory_);
    state.Append(Done("a.obj"));
  }
  Write(kBatchStateFile, ToLine(Done("b.obj")).substr(0, 40), std::ios::app);
  {
    BatchState state(directory_);
    EXPECT_TRUE(state.Find("a.obj"));
    EXPECT_FALSE(state.Find("b.obj"));
    state.Append(Done("c.obj"));
  }
  BatchState state(directory_);
  EXPECT_TRUE(state.Find("a.obj"));
  EXPECT_TRUE(state.Find("c.obj")) << "on a line of its own";
}

TEST_F(BatchStateTest, OnlyTheBytesThatWereWrittenAreIntact) {
  BatchRecord record = Done("a.gltf");
  record.files = {{"a.gltf", FileDigest(Write("a.gltf", "1"))}, {"a.bin", FileDigest(Write("a.bin", "2"))}};
  const BatchState state(directory_);
  EXPECT_TRUE(state.IsIntact(record));
  Write("a.bin", "3");
  EXPECT_FALSE(state.IsIntact(record));
  fs::remove(directory_ + "/a.bin");
  EXPECT_FALSE(state.IsIntact(record));
}

TEST_F(BatchStateTest, OneBatchAtATime) {
  {
    const BatchState state(directory_);
    try {
      BatchState another(directory_);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "BATCH_RUNNING");
    }
  }
  EXPECT_NO_THROW(BatchState{directory_});
  EXPECT_THROW(BatchState(directory_ + "/none"), Error);
}

TEST_F(BatchStateTest, ManyThreadsAppend) {
  {
    BatchState state(directory_);
    std::vector<std::jthread> threads;
    for (int t = 0; t < 8; ++t) {
      threads.emplace_back([&state, t] {
        for (int i = 0; i < 50; ++i) state.Append(Done(std::to_string(t) + "/" + std::to_string(i)));
      });
    }
  }
  const BatchState state(directory_);
  for (int t = 0; t < 8; ++t) {
    for (int i = 0; i < 50; ++i) EXPECT_TRUE(state.Find(std::to_string(t) + "/" + std::to_string(i)));
  }
}

}  // namespace
}  // namespace planish::cli
