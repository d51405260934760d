// `planish unwrap` of many files: what one bad file, a kill, Ctrl-C and a second run do to the others.
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "planish/client.h"
#include "tests/e2e/command.h"
#include "tests/e2e/meshes.h"

namespace planish::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

// The lines of --json.
struct BatchReport {
  explicit BatchReport(const std::string& out) {
    for (const std::string& line : Lines(out)) {
      const json one = json::parse(line);
      if (one.contains("summary")) {
        summary = one["summary"];
      } else {
        files[one["file"]] = one;
      }
    }
  }
  std::string Result(const std::string& file) const { return files.contains(file) ? files.at(file)["result"] : ""; }
  bool Kept(const std::string& file) const { return files.contains(file) && files.at(file)["kept"].get<bool>(); }

  std::map<std::string, json> files;
  json summary;
};

class BatchTest : public ::testing::Test {
 protected:
  BatchTest() {
    fs::create_directories(In("sub"));
    fs::create_directories(directory_.Path("sockets"));
  }

  std::string In(const std::string& name) const { return directory_.Path("in/" + name); }
  std::string Out(const std::string& name = "") const { return directory_.Path("out/" + name); }
  void File(const std::string& name, const std::string& text) const { PutFile(In(name), text); }
  std::vector<std::string> Words(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"unwrap", In(""), "-o", Out(), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::map<std::string, std::string> Environment() const { return {{"XDG_RUNTIME_DIR", directory_.Path("sockets")}}; }
  Outcome Run(const std::vector<std::string>& more = {}) const { return Planish(Words(more), Environment()); }
  // Of everything in out/, but the memory, and what a killed writer leaves.
  std::map<std::string, std::string> Outputs() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(Out())) {
      if (!entry.is_regular_file() || entry.path().filename().native().front() == '.') continue;
      files[fs::relative(entry.path(), Out())] = ReadFile(entry.path());
    }
    return files;
  }

  TempDir directory_;
};

TEST_F(BatchTest, OneBadFileHurtsOnlyItself) {
  File("grid.obj", GridObj(12));
  File("sub/grid.ply", GridPly(8));
  File("sub/scan.stl", GridStl(6));
  File("bad.obj", "v 0 0 0\nv 1 0 zero\n");
  File("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
  File("empty.glb", "");
  File("grid.mtl", "newmtl a\n");
  File("odd\xff\n.obj", GridObj(5));
  const Outcome run = Run({"--progress=json"});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  const BatchReport lines(run.out);
  ASSERT_EQ(lines.files.size(), 7u) << run.out;
  EXPECT_EQ(lines.Result("grid.obj"), "usable");
  EXPECT_EQ(lines.files.at("grid.obj")["input"]["triangles"], 288);
  EXPECT_EQ(lines.files.at("grid.obj")["output"], Out("grid.obj"));
  EXPECT_EQ(lines.files.at("grid.obj")["charts"][0]["converged"], true);
  EXPECT_EQ(lines.Result("sub/grid.ply"), "usable");
  EXPECT_EQ(lines.Result("sub/scan.stl"), "usable");
  EXPECT_EQ(lines.Result("bad.obj"), "failed");
  EXPECT_EQ(lines.files.at("bad.obj")["error"]["reason"], "FILE_MALFORMED");
  EXPECT_EQ(lines.files.at("nan.obj")["error"]["reason"], "MESH_POSITION_NOT_FINITE");
  EXPECT_EQ(lines.Result("empty.glb"), "failed");
  EXPECT_EQ(lines.Result("odd\xef\xbf\xbd\n.obj"), "usable") << "whatever a file is called";
  EXPECT_EQ(lines.summary["files"], 7);
  EXPECT_EQ(lines.summary["usable"], 4);
  EXPECT_EQ(lines.summary["failed"], 3);
  EXPECT_EQ(lines.summary["skipped"][".mtl"], 1);
  EXPECT_EQ(lines.summary["exit_code"], 1);
  EXPECT_THAT(run.err, HasSubstr("7 files: 4 usable, 3 failed; 538 triangles in "));
  EXPECT_THAT(run.err, HasSubstr(R"({"file":"sub/grid.ply","sequence":1)"));
  EXPECT_THAT(run.err, HasSubstr(R"({"file":"bad.obj","result":"failed"})"));
  std::vector<std::string> names;
  for (const auto& [name, bytes] : Outputs()) {
    names.push_back(name);
    EXPECT_THAT(bytes, name.ends_with("ply") ? HasSubstr("property float s") : HasSubstr("\nvt "));
  }
  EXPECT_THAT(names, ::testing::ElementsAre("grid.obj", "odd\xff\n.obj", "sub/grid.ply", "sub/scan.obj"));
  EXPECT_TRUE(fs::is_empty(directory_.Path("sockets")));

  // As one file by itself.
  ASSERT_EQ(Planish({"unwrap", In("grid.obj"), "-o", directory_.Path("alone.obj")}).exit_code, 0);
  EXPECT_EQ(ReadFile(directory_.Path("alone.obj")), ReadFile(Out("grid.obj")));
}

TEST_F(BatchTest, WhatIsDoneAndCurrentIsNotDoneAgain) {
  File("a.obj", GridObj(8));
  File("b.obj", GridObj(8, 1));
  File("sub/c.obj", GridObj(8, 2));
  ASSERT_EQ(Run().exit_code, 0);
  const auto outputs = Outputs();
  EXPECT_EQ(outputs.size(), 3u);
  const auto done_again = [&](const std::vector<std::string>& more) {
    const Outcome run = Run(more);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const BatchReport lines(run.out);
    std::set<std::string> again;
    for (const auto& [name, line] : lines.files) {
      EXPECT_EQ(line["result"], "usable");
      EXPECT_EQ(line["input"]["triangles"], 128) << "told of kept files as well";
      if (!lines.Kept(name)) again.insert(name);
    }
    EXPECT_EQ(lines.summary["kept"], static_cast<int>(3 - again.size()));
    return again;
  };
  EXPECT_THAT(done_again({}), ::testing::IsEmpty());
  EXPECT_THAT(done_again({"--threads=2"}), ::testing::IsEmpty()) << "threads change no byte";
  EXPECT_THAT(done_again({"--again"}), ::testing::SizeIs(3));
  EXPECT_EQ(Outputs(), outputs);
  fs::last_write_time(In("a.obj"), fs::file_time_type::clock::now());
  EXPECT_THAT(done_again({}), ::testing::IsEmpty()) << "content counts, not time";
  fs::remove(Out("a.obj"));
  PutFile(Out("b.obj"), "changed");
  EXPECT_THAT(done_again({}), ::testing::ElementsAre("a.obj", "b.obj"));
  EXPECT_EQ(Outputs(), outputs);
  File("sub/c.obj", GridObj(8, 3));
  EXPECT_THAT(done_again({}), ::testing::ElementsAre("sub/c.obj"));
  EXPECT_THAT(done_again({"--padding=4"}), ::testing::SizeIs(3)) << "other options";
}

TEST_F(BatchTest, KilledRunGoesOnWhereItWas) {
  constexpr int kFiles = 8;
  for (int i = 0; i < kFiles; ++i) File("grid" + std::to_string(i) + ".obj", GridObj(90, 0.1 * i));
  {
    Command command(Words({"--progress=json"}), Environment());
    ASSERT_TRUE(command.WaitForErr("\"result\":\"usable\"", 60)) << command.Err();
    command.Signal(SIGKILL);
    command.Wait();
  }
  // What is there is whole, and a line that was being written is forgotten.
  const auto before = Outputs();
  EXPECT_LT(before.size(), static_cast<std::size_t>(kFiles));
  PutFile(Out(".planish-batch.json"), "{\"output\":\"grid7.obj\",\"sta", true);
  Outcome run = Run();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const BatchReport lines(run.out);
  EXPECT_EQ(lines.summary["usable"], kFiles);
  EXPECT_GE(lines.summary["kept"].get<int>(), 1);
  EXPECT_LT(lines.summary["kept"].get<int>(), kFiles);
  const auto after = Outputs();
  EXPECT_EQ(after.size(), static_cast<std::size_t>(kFiles));
  for (const auto& [name, bytes] : before) {
    EXPECT_EQ(after.at(name), bytes) << name;
  }
  run = Run();
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(BatchReport(run.out).summary["kept"], kFiles);
}

TEST_F(BatchTest, CtrlCCancelsWhatIsInFlightAndKeepsTheRest) {
  File("a.obj", GridObj(4));
  for (const char* name : {"b.obj", "c.obj", "d.obj"}) File(name, GridObj(250));
  std::vector<std::string> more = kSlowly;
  more.push_back("--progress=json");
  Command command(Words(more), Environment());
  ASSERT_TRUE(command.WaitForErr(R"({"file":"a.obj","result":"usable"})", 60)) << command.Err();
  ASSERT_TRUE(command.WaitForErr("\"linear_iterations\":1", 60)) << command.Err();
  command.Signal(SIGINT);
  const Outcome outcome = command.Wait();
  EXPECT_EQ(outcome.exit_code, 130);
  EXPECT_THAT(outcome.err, HasSubstr("the same command goes on"));
  const BatchReport lines(outcome.out);
  EXPECT_EQ(lines.Result("a.obj"), "usable");
  EXPECT_EQ(lines.Result("b.obj"), "cancelled");
  EXPECT_EQ(lines.summary["cancelled"].get<int>() + lines.summary["not_tried"].get<int>(), 3);
  EXPECT_EQ(lines.summary["exit_code"], 130);
  EXPECT_EQ(Outputs().size(), 1u);
  EXPECT_TRUE(fs::is_empty(directory_.Path("sockets")));
}

TEST_F(BatchTest, SecondCtrlCLeavesAtOnce) {
  PrivateServer server(ServerOptions(2));
  for (const char* name : {"a.obj", "b.obj"}) File(name, GridObj(250));
  std::vector<std::string> more = kSlowly;
  more.insert(more.end(), {"--progress=json", "--server=" + server.target()});
  Command command(Words(more));
  ASSERT_TRUE(command.WaitForErr("\"linear_iterations\":1", 60)) << command.Err();
  kill(server.pid(), SIGSTOP);  // so that the first cannot be answered
  command.Signal(SIGINT);
  ASSERT_TRUE(command.WaitForErr("Ctrl-C again", 60)) << command.Err();
  const double second = Now();
  command.Signal(SIGINT);
  EXPECT_EQ(command.Wait().exit_code, 130);
  EXPECT_LT(Now() - second, 5) << "the server is stopped and would be waited for without end";
  kill(server.pid(), SIGCONT);
}

TEST_F(BatchTest, BadUsageIsRefusedBeforeAnythingRuns) {
  File("a.obj", GridObj(4));
  File("a.stl", GridStl(4));
  Outcome run = Run();
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("would both become"));
  EXPECT_FALSE(fs::exists(Out()));
  run = Planish({"unwrap", In(""), "-o", In("")});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(ReadFile(In("a.obj")), GridObj(4));

  fs::remove(In("a.stl"));
  run = Planish({"unwrap", directory_.Path("x.obj"), directory_.Path("y.obj"), "-o", Out()});
  EXPECT_EQ(run.exit_code, 2) << "nothing could be read";
  run = Run({"--hessian=exact", "--solver=direct"});
  EXPECT_EQ(run.exit_code, 2) << run.err;
  run = Planish({"unwrap", In("a.obj"), directory_.Path("y.obj"), "-o", Out(), "--json"});
  EXPECT_EQ(run.exit_code, 1) << "one could";
  EXPECT_EQ(BatchReport(run.out).files.at("y.obj")["error"]["reason"], "FILE_UNREADABLE");
}

TEST_F(BatchTest, NoServer) {
  File("a.obj", GridObj(4));
  Outcome run = Run({"--server=127.0.0.1:1"});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_LT(run.seconds, 5);
  const json line = json::parse(run.out);
  EXPECT_EQ(line["error"]["reason"], "SERVER_UNREACHABLE");
  EXPECT_EQ(line["summary"]["not_tried"], 1);

  // It goes away in the middle: what was done is kept.
  for (const char* name : {"b.obj", "c.obj", "d.obj"}) File(name, GridObj(250));
  std::vector<std::string> more = kSlowly;
  more.push_back("--progress=json");
  Command command(Words(more), Environment());
  ASSERT_TRUE(command.WaitForErr(R"({"file":"a.obj","result":"usable"})", 60)) << command.Err();
  ASSERT_TRUE(command.WaitForErr("\"linear_iterations\":1", 60)) << command.Err();
  const std::vector<pid_t> servers = ChildrenOf(command.pid());
  ASSERT_EQ(servers.size(), 1u);
  kill(servers[0], SIGKILL);
  run = command.Wait();
  EXPECT_EQ(run.exit_code, 3) << run.err;
  EXPECT_LT(run.seconds, 60);
  const BatchReport lines(run.out);
  EXPECT_EQ(lines.Result("a.obj"), "usable");
  EXPECT_EQ(lines.Result("b.obj"), "failed");
  EXPECT_EQ(Outputs().size(), 1u);
}

TEST_F(BatchTest, FullQueueIsNoError) {
  PrivateServer server(ServerOptions(1, {"--queue=1"}));
  for (int i = 0; i < 10; ++i) File("grid" + std::to_string(i) + ".obj", GridObj(20, 0.1 * i));
  const Outcome run = Run({"--server=" + server.target()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(BatchReport(run.out).summary["usable"], 10);
}

TEST_F(BatchTest, DetachedBatchIsFetchedByTheSameCommand) {
  std::optional<PrivateServer> server;
  server.emplace(ServerOptions(2, {"--queue=2"}));
  for (int i = 0; i < 6; ++i) File("grid" + std::to_string(i) + ".obj", GridObj(12, 0.1 * i));
  const std::string address = "--server=" + server->target();
  Outcome run = Run({address, "--detach"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  BatchReport lines(run.out);
  EXPECT_EQ(lines.summary["queued"], 6);
  EXPECT_TRUE(Outputs().empty());
  const std::string job = lines.files.at("grid3.obj")["job"];

  run = Run({address});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  lines = BatchReport(run.out);
  EXPECT_EQ(lines.summary["usable"], 6);
  EXPECT_EQ(lines.summary["kept"], 0);
  EXPECT_EQ(lines.files.at("grid3.obj")["job"], job) << "that very job";
  EXPECT_EQ(Client(server->target()).ListJobs(0).size(), 6u);
  ASSERT_EQ(Planish({"unwrap", In("grid3.obj"), "-o", directory_.Path("alone.obj")}).exit_code, 0);
  EXPECT_EQ(ReadFile(directory_.Path("alone.obj")), ReadFile(Out("grid3.obj")));

  // Jobs that the server does not know any more are queued anew.
  ASSERT_EQ(Run({address, "--detach", "--padding=4"}).exit_code, 0);
  for (const Job& known : Client(server->target()).ListJobs(0)) {
    Client(server->target()).WatchJob(known.name);
    Client(server->target()).DeleteJob(known.name);
  }
  run = Run({address, "--padding=4"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(BatchReport(run.out).summary["usable"], 6);
}

TEST_F(BatchTest, JobWhoseAnswerWasLostIsNotQueuedTwice) {
  PrivateServer server(ServerOptions(1, {}));
  File("grid.obj", GridObj(12));
  const std::string address = "--server=" + server.target(), state = Out(".planish-batch.json");
  Outcome run = Run({address, "--detach"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string job = BatchReport(run.out).files.at("grid.obj")["job"];
  // As if the run had been killed before it could write down the answer.
  const std::string lines = ReadFile(state);
  PutFile(state, lines.substr(0, lines.find('\n') + 1));
  for (const std::vector<std::string>& words : {std::vector<std::string>{address, "--detach"}, {address}}) {
    run = Run(words);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(BatchReport(run.out).files.at("grid.obj")["job"], job);
  }
  EXPECT_EQ(Client(server.target()).ListJobs(0).size(), 1u);
}

TEST_F(BatchTest, OneAtlasForSeveralFiles) {
  File("a.obj", GridObj(6));
  File("b.obj", GridObj(6, 1));
  const std::vector<std::string> words = {"unwrap", In("a.obj"), In("b.obj"), "-o", Out(), "--json"};
  std::vector<std::string> together = words;
  together.push_back("--one-atlas");
  Outcome run = Planish(together);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(json::parse(run.out)["input"]["triangles"], 144);
  EXPECT_FALSE(fs::exists(Out(".planish-batch.json")));
  const auto shared = Outputs();
  ASSERT_EQ(shared.size(), 2u);
  run = Planish(words);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(BatchReport(run.out).summary["usable"], 2);
  EXPECT_NE(Outputs().at("a.obj"), shared.at("a.obj")) << "a tile for itself";
}

TEST_F(BatchTest, FormatForAll) {
  File("a.obj", GridObj(4));
  File("b.stl", GridStl(4));
  const Outcome run = Run({"--format=gltf"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::vector<std::string> names;
  for (const auto& [name, bytes] : Outputs()) names.push_back(name);
  EXPECT_THAT(names, ::testing::IsSupersetOf({"a.gltf", "b.gltf"}));
  EXPECT_EQ(BatchReport(Run({"--format=gltf"}).out).summary["kept"], 2);
}

}  // namespace
}  // namespace planish::testing
