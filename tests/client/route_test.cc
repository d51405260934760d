// Calls that a proxy has to send to one server among several: those about its jobs and uploads.
#include "client/src/route.h"

#include <chrono>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using testing::Bytes;
using ::testing::ElementsAre;
using testing::FakeServer;
using testing::FakeStream;
using testing::FakeUpload;
using testing::MakeStatus;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;
using Status = google::rpc::Status;

using testing::kPositions;
using testing::kTriangles;
using testing::kUv;

TEST(Route, IsTheNameBeforeTheFirstDot) {
  EXPECT_EQ(RouteOf("jobs/planish-0.1a2b"), "planish-0");
  EXPECT_EQ(RouteOf("uploads/a.1a2b"), "a");
  EXPECT_EQ(RouteOf("jobs/a.b.c"), "a");
  EXPECT_EQ(RouteOf("jobs/1a2b"), "") << "a server without a name";
  EXPECT_EQ(RouteOf(""), "");
  EXPECT_EQ(RouteOf("planish-0.1a2b"), "");
  EXPECT_EQ(RouteOf("jobs/"), "");
  EXPECT_EQ(RouteOf("jobs/" + std::string(63, 'a') + ".1"), std::string(63, 'a'));
  EXPECT_EQ(RouteOf("jobs/" + std::string(64, 'a') + ".1"), "");
  // What people type must not become a header that nobody can send.
  EXPECT_EQ(RouteOf("jobs/A.1"), "");
  EXPECT_EQ(RouteOf("jobs/a b.1"), "");
  EXPECT_EQ(RouteOf("jobs/a\r\n.1"), "");
  EXPECT_EQ(RouteOf("jobs/caf\xc3\xa9.1"), "");
}

class RouteTest : public ::testing::Test {
 protected:
  RouteTest() {
    server_.on_route = [this](const std::string& method, const std::string& route) {
      const std::lock_guard lock(mutex_);
      routes_[method].insert(route);
    };
    server_.on_job = [](const std::string&, const std::string& name, v1::Job& job) {
      job.set_name(name);
      return Status();
    };
  }

  ClientOptions Options() const {
    ClientOptions options;
    options.reattach_seconds = 10;
    options.reattach_backoff_seconds = 0.01;
    return options;
  }

  v1::JobEvent Named(v1::JobEvent event) const {
    if (event.has_job()) event.mutable_job()->set_name("jobs/b.1");
    return event;
  }

  std::map<std::string, std::set<std::string>> Routes() {
    const std::lock_guard lock(mutex_);
    return routes_;
  }

  // What calls of each name said.
  std::mutex mutex_;
  std::map<std::string, std::set<std::string>> routes_;
  FakeServer server_;
};

TEST_F(RouteTest, CallsAboutAJobNameItsServer) {
  Client client(server_.target(), Options());
  client.GetJob("jobs/b.1");
  client.StopJob("jobs/b.1");
  client.CancelJob("jobs/b.1");
  client.DeleteJob("jobs/b.1");
  server_.on_watch = [this](const v1::WatchJobRequest&, FakeStream& stream) {
    stream.Send(Named(testing::StateEvent(1, v1::JOB_STATE_CANCELLED)));
    return Status();
  };
  client.WatchJob("jobs/b.1");
  EXPECT_THAT(Routes(), UnorderedElementsAre(Pair("GetJob", ElementsAre("b")), Pair("StopJob", ElementsAre("b")),
                                             Pair("CancelJob", ElementsAre("b")), Pair("DeleteJob", ElementsAre("b")),
                                             Pair("WatchJob", ElementsAre("b"))));
}

TEST_F(RouteTest, ThereIsNoneWhereServersHaveNoNames) {
  Client client(server_.target(), Options());
  client.GetJob("jobs/1");
  server_.on_capabilities = [](v1::Capabilities&) { return Status(); };
  client.GetCapabilities();
  EXPECT_THAT(Routes(),
              UnorderedElementsAre(Pair("GetJob", ElementsAre("")), Pair("GetCapabilities", ElementsAre(""))));
}

TEST_F(RouteTest, ReattachingGoesToTheServerThatHasTheJob) {
  std::string draco;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    draco = request.spec().draco();
    stream.Send(Named(testing::StateEvent(1, v1::JOB_STATE_QUEUED)));
    return MakeStatus(14, "Socket closed");
  };
  server_.on_watch = [&](const v1::WatchJobRequest& request, FakeStream& stream) {
    EXPECT_EQ(request.name(), "jobs/b.1");
    stream.Send(Named(testing::SuccessEvent(2, draco, Bytes(kUv))));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  EXPECT_EQ(Client(server_.target(), Options()).Unwrap({kPositions, kTriangles}).job, "jobs/b.1");
  EXPECT_THAT(Routes(), UnorderedElementsAre(Pair("Unwrap", ElementsAre("")), Pair("WatchJob", ElementsAre("b"))));
}

TEST_F(RouteTest, CancellingAndStoppingInTheBackgroundToo) {
  for (const bool stops : {false, true}) {
    server_.on_unwrap = [&](const v1::UnwrapRequest&, FakeStream& stream) {
      stream.Send(Named(testing::StateEvent(1, v1::JOB_STATE_RUNNING)));
      while (!stream.IsCancelled() && !Routes().contains(stops ? "StopJob" : "CancelJob")) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      stream.Send(Named(testing::StateEvent(2, v1::JOB_STATE_CANCELLED)));
      return Status();
    };
    Client client(server_.target(), Options());
    Call call = client.StartUnwrap({kPositions, kTriangles});
    while (call.job().empty()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    stops ? call.Stop() : call.Cancel();
    EXPECT_THROW(call.Wait(), Error);
  }
  EXPECT_THAT(Routes(), UnorderedElementsAre(Pair("Unwrap", ElementsAre("")), Pair("CancelJob", ElementsAre("b")),
                                             Pair("StopJob", ElementsAre("b"))));
}

// The mesh is where its upload is, so the job has to go there as well.
TEST_F(RouteTest, UploadsAndTheJobsMadeFromThem) {
  server_.on_capabilities = [](v1::Capabilities& capabilities) {
    capabilities.set_upload_chunk_bytes(1 << 20);
    return Status();
  };
  v1::Upload known;
  std::string draco;
  server_.on_create_upload = [&](const v1::CreateUploadRequest& request, v1::Upload& upload) {
    known.set_name("uploads/b.7");
    known.set_total_bytes(request.total_bytes());
    upload = known;
    return Status();
  };
  int writes = 0;
  server_.on_write_upload = [&](FakeUpload& call, v1::Upload& upload) {
    v1::WriteUploadRequest message;
    while (call.Next(message)) draco = message.data();
    if (++writes == 1) return MakeStatus(14, "Socket closed");
    upload = known;
    upload.set_committed_bytes(known.total_bytes());
    return Status();
  };
  server_.on_get_upload = [&](const std::string&, v1::Upload& upload) {
    upload = known;
    return Status();
  };
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    EXPECT_EQ(request.spec().upload(), "uploads/b.7");
    stream.Send(Named(testing::SuccessEvent(1, draco, Bytes(kUv))));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  server_.on_create = [](const v1::CreateJobRequest&, v1::Job& job) {
    job.set_name("jobs/b.2");
    return Status();
  };
  ClientOptions options = Options();
  options.inline_mesh_bytes = 0;
  Client client(server_.target(), options);
  EXPECT_EQ(client.Unwrap({kPositions, kTriangles}).job, "jobs/b.1");
  EXPECT_EQ(client.CreateJob({kPositions, kTriangles}).name, "jobs/b.2");
  EXPECT_THAT(Routes(),
              UnorderedElementsAre(Pair("GetCapabilities", ElementsAre("")), Pair("CreateUpload", ElementsAre("")),
                                   Pair("WriteUpload", ElementsAre("b")), Pair("GetUpload", ElementsAre("b")),
                                   Pair("Unwrap", ElementsAre("b")), Pair("CreateJob", ElementsAre("b"))));
}

// Page tokens are the server's that made them.
TEST_F(RouteTest, FurtherPagesAreOfTheSameServer) {
  std::vector<std::string> routes;
  server_.on_route = [&](const std::string&, const std::string& route) { routes.push_back(route); };
  server_.on_list = [](const v1::ListJobsRequest& request, v1::ListJobsResponse& response) {
    response.add_jobs()->set_name("jobs/b.1");
    if (request.page_token().empty()) response.set_next_page_token("more");
    return Status();
  };
  EXPECT_EQ(Client(server_.target(), Options()).ListJobs(0).size(), 2u);
  EXPECT_THAT(routes, ElementsAre("", "b"));
}

}  // namespace
}  // namespace planish
