// The calls that answer once.
#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

// Runs `call` (a pointer to a Stub method) with a context of its own.
template <class Request, class Response>
grpc::Status Call(RpcTestServer& server,
                  grpc::Status (v1::Planish::Stub::*call)(grpc::ClientContext*, const Request&, Response*),
                  const Request& request, Response* response) {
  grpc::ClientContext context;
  return (server.stub().*call)(&context, request, response);
}

v1::CreateJobRequest MeshRequest() {
  v1::CreateJobRequest request;
  request.mutable_spec()->set_draco("mesh");
  return request;
}

grpc::Status TryCreate(RpcTestServer& server, const v1::CreateJobRequest& request) {
  v1::Job job;
  return Call(server, &v1::Planish::Stub::CreateJob, request, &job);
}

v1::Job Get(RpcTestServer& server, const std::string& name) {
  v1::GetJobRequest request;
  request.set_name(name);
  v1::Job job;
  EXPECT_TRUE(Call(server, &v1::Planish::Stub::GetJob, request, &job).ok());
  return job;
}

void FollowToTheEnd(RpcTestServer& server, const std::string& name) {
  Follow(*server.manager().Watch(kEverybody, name, false, false)->events);
}

TEST(JobsRpc, CreateAndGet) {
  RpcTestServer server(Succeed(3, "uv"));
  v1::CreateJobRequest request = MeshRequest();
  (*request.mutable_spec()->mutable_labels())["file"] = "spot";
  request.set_request_id("r1");
  v1::Job job;
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::CreateJob, request, &job).ok());
  EXPECT_THAT(job.name(), ::testing::StartsWith("jobs/"));
  EXPECT_EQ(job.state(), v1::JOB_STATE_QUEUED);
  FollowToTheEnd(server, job.name());
  v1::Job again;
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::CreateJob, request, &again).ok());
  EXPECT_EQ(again.name(), job.name());
  const v1::Job ended = Get(server, job.name());
  EXPECT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(ended.labels().at("file"), "spot");
  EXPECT_TRUE(ended.has_report());
}

TEST(JobsRpc, BadRequestsNameTheField) {
  JobManagerOptions options;
  options.max_mesh_bytes = 1 << 20;
  options.validate_options = [](const v1::UnwrapOptions& o) {
    return o.tolerance() < 0
               ? MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID", "bad", {{"field", "tolerance"}})
               : absl::OkStatus();
  };
  RpcTestServer server(Succeed(1, "uv"), options);
  grpc::Status status = TryCreate(server, v1::CreateJobRequest());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(InfoOf(status).reason(), "MESH_MISSING");
  EXPECT_EQ(InfoOf(status).metadata().at("field"), "spec.mesh");
  EXPECT_EQ(ViolationOf(status), "spec.mesh");

  v1::CreateJobRequest request = MeshRequest();
  request.mutable_spec()->mutable_options()->set_tolerance(-1);
  status = TryCreate(server, request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(InfoOf(status).metadata().at("field"), "spec.options.tolerance");
  EXPECT_EQ(ViolationOf(status), "spec.options.tolerance");

  request.mutable_spec()->set_draco(std::string((1 << 20) + 1, 'x'));
  status = TryCreate(server, request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(InfoOf(status).reason(), "MESH_TOO_LARGE");
  EXPECT_FALSE(HasRetryInfo(status));

  request.mutable_spec()->set_draco(std::string(18 << 20, 'x'));
  status = TryCreate(server, request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(InfoOf(status).reason(), "MESH_TOO_LARGE") << "of the message";
  EXPECT_THAT(status.error_message(), HasSubstr("CreateJob takes at most"));
}

TEST(JobsRpc, FullQueueAsksForARetry) {
  JobManagerOptions options;
  options.limits.queue_capacity = 1;
  RpcTestServer server(WaitForCancel(), options);
  const auto create = [&server](const std::string& mesh) {
    v1::CreateJobRequest request = MeshRequest();
    request.mutable_spec()->set_draco(mesh);
    return TryCreate(server, request);
  };
  ASSERT_TRUE(create("runs").ok());
  ASSERT_TRUE(create("waits").ok());
  const grpc::Status status = create("too many");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(InfoOf(status).reason(), "QUEUE_FULL");
  EXPECT_TRUE(HasRetryInfo(status));
}

TEST(JobsRpc, UnknownNames) {
  RpcTestServer server(Succeed(1, "uv"));
  v1::Job job;
  google::protobuf::Empty empty;
  for (const std::string& name : {std::string("jobs/none"), std::string(), std::string(1 << 15, 'x')}) {
    v1::GetJobRequest get;
    get.set_name(name);
    v1::CancelJobRequest cancel;
    cancel.set_name(name);
    v1::DeleteJobRequest erase;
    erase.set_name(name);
    for (const grpc::Status& status : {Call(server, &v1::Planish::Stub::GetJob, get, &job),
                                       Call(server, &v1::Planish::Stub::CancelJob, cancel, &job),
                                       Call(server, &v1::Planish::Stub::DeleteJob, erase, &empty)}) {
      EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND) << status.error_message();
      EXPECT_EQ(InfoOf(status).reason(), "JOB_NOT_FOUND");
    }
  }
}

TEST(JobsRpc, CancelThenDelete) {
  RpcTestServer server(WaitForCancel());
  const std::string name = server.Create();
  WaitForEvent(*server.manager().Watch(kEverybody, name, false, false)->events, 3);

  v1::DeleteJobRequest erase;
  erase.set_name(name);
  google::protobuf::Empty empty;
  grpc::Status status = Call(server, &v1::Planish::Stub::DeleteJob, erase, &empty);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(InfoOf(status).reason(), "JOB_NOT_FINISHED");

  v1::CancelJobRequest cancel;
  cancel.set_name(name);
  v1::Job job;
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::CancelJob, cancel, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_STOPPING);
  FollowToTheEnd(server, name);
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::CancelJob, cancel, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_CANCELLED);
  EXPECT_TRUE(Call(server, &v1::Planish::Stub::DeleteJob, erase, &empty).ok());
}

TEST(JobsRpc, StopReachesTheWorker) {
  RpcTestServer server([](ServerLink& link, const ServerLink::Received&) {
    link.Send(ProgressMessage(1));
    while (const auto received = link.Receive()) {
      if (!received->message.has_stop()) continue;
      SendSuccess(link, "the best so far");
      return true;
    }
    return false;
  });
  v1::StopJobRequest request;
  v1::Job job;
  request.set_name("jobs/none");
  const grpc::Status unknown = Call(server, &v1::Planish::Stub::StopJob, request, &job);
  EXPECT_EQ(unknown.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(InfoOf(unknown).reason(), "JOB_NOT_FOUND");

  const std::string name = server.Create();
  request.set_name(name);
  WaitForEvent(*server.manager().Watch(kEverybody, name, false, false)->events, 3);
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::StopJob, request, &job).ok());
  EXPECT_TRUE(job.stop_requested());
  FollowToTheEnd(server, name);
  EXPECT_EQ(Get(server, name).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(Call(server, &v1::Planish::Stub::StopJob, request, &job).ok()) << "too late is no error";
}

TEST(JobsRpc, ListInPages) {
  RpcTestServer server(Succeed(1, "uv"));
  const std::string first = server.Create();
  const std::string second = server.Create();
  FollowToTheEnd(server, second);
  v1::ListJobsRequest request;
  request.set_page_size(1);
  v1::ListJobsResponse page;
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::ListJobs, request, &page).ok());
  ASSERT_EQ(page.jobs_size(), 1);
  EXPECT_EQ(page.jobs(0).name(), second);
  request.set_page_token(page.next_page_token());
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::ListJobs, request, &page).ok());
  ASSERT_EQ(page.jobs_size(), 1);
  EXPECT_EQ(page.jobs(0).name(), first);
  EXPECT_EQ(page.next_page_token(), "");

  request.set_page_token("stolen");
  const grpc::Status status = Call(server, &v1::Planish::Stub::ListJobs, request, &page);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(InfoOf(status).metadata().at("field"), "page_token");
}

TEST(JobsRpc, Capabilities) {
  RpcTestServer server(Succeed(1, "uv"));
  v1::Capabilities capabilities;
  ASSERT_TRUE(Call(server, &v1::Planish::Stub::GetCapabilities, v1::GetCapabilitiesRequest(), &capabilities).ok());
  EXPECT_EQ(capabilities.version(), "1.2.3");
}

TEST(JobsRpc, DrainingServerSaysSo) {
  RpcTestServer server(Succeed(1, "uv"));
  EXPECT_EQ(server.CallBytes("/grpc.health.v1.Health/Check", ""), kServing);
  EXPECT_EQ(server.CallBytes("/grpc.health.v1.Health/Check", "\x0a\x12planish.v1.Planish"), kServing);
  server.rpc().SetReady(false);
  server.manager().Drain([] {});
  EXPECT_EQ(server.CallBytes("/grpc.health.v1.Health/Check", "\x0a\x12planish.v1.Planish"), kNotServing);
  EXPECT_EQ(server.CallBytes("/grpc.health.v1.Health/Check", ""), kServing) << "draining is no reason to restart";
  const grpc::Status status = TryCreate(server, MeshRequest());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(InfoOf(status).reason(), "DRAINING");
  EXPECT_TRUE(HasRetryInfo(status));
}

TEST(JobsRpc, ReflectionNamesTheService) {
  RpcTestServer server(Succeed(1, "uv"));
  const std::string list_services("\x3a\x00", 2);
  EXPECT_THAT(server.CallBytes("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", list_services),
              HasSubstr("planish.v1.Planish"));
}

}  // namespace
}  // namespace planish
