// Waiting, results in pieces, batches, arrays, and what a refusal says of the field that is wrong.
#include <array>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/worker/needs.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

using Stub = v1::Planish::Stub;

template <class Request, class Response>
grpc::Status Ask(RpcTestServer& server, grpc::Status (Stub::*call)(grpc::ClientContext*, const Request&, Response*),
                 const Request& request, Response* response) {
  grpc::ClientContext context;
  return (server.stub().*call)(&context, request, response);
}

v1::WaitJobRequest WaitFor(const std::string& name, double seconds) {
  v1::WaitJobRequest request;
  request.set_name(name);
  request.mutable_timeout()->set_seconds(static_cast<std::int64_t>(seconds));
  request.mutable_timeout()->set_nanos(static_cast<std::int32_t>((seconds - static_cast<int>(seconds)) * 1e9));
  return request;
}

// Waits for the gate, then delivers.
WorkerScript SucceedAt(Gate* gate, const std::string& uv) {
  return [gate, uv](ServerLink& link, const ServerLink::Received&) {
    gate->Wait();
    SendSuccess(link, uv);
    return true;
  };
}

TEST(WaitJob, AnswersWhenTheJobEnds) {
  Gate gate;
  RpcTestServer server(SucceedAt(&gate, "uv"));
  const std::string name = server.Create();
  v1::Job job;
  ASSERT_TRUE(Ask(server, &Stub::WaitJob, WaitFor(name, 0), &job).ok());
  EXPECT_NE(job.state(), v1::JOB_STATE_SUCCEEDED) << "0 asks without waiting";
  ASSERT_TRUE(Ask(server, &Stub::WaitJob, WaitFor(name, 0.05), &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_RUNNING) << "the timeout passed";
  std::vector<std::jthread> waiting;
  std::array<v1::Job, 3> ends;
  for (v1::Job& end : ends) {
    waiting.emplace_back([&] { EXPECT_TRUE(Ask(server, &Stub::WaitJob, WaitFor(name, 60), &end).ok()); });
  }
  gate.Open();
  waiting.clear();
  for (const v1::Job& end : ends) {
    EXPECT_EQ(end.state(), v1::JOB_STATE_SUCCEEDED);
    EXPECT_TRUE(end.has_report());
  }
  v1::WaitJobRequest basic = WaitFor(name, 60);
  basic.set_view(v1::JOB_VIEW_BASIC);
  ASSERT_TRUE(Ask(server, &Stub::WaitJob, basic, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << "a job that has ended is not waited for";
  EXPECT_FALSE(job.has_report());
}

TEST(WaitJob, SaysWhatIsWrong) {
  RpcTestServer server(WaitForCancel());
  v1::Job job;
  grpc::Status status = Ask(server, &Stub::WaitJob, WaitFor("jobs/none", 60), &job);
  EXPECT_EQ(InfoOf(status).reason(), "JOB_NOT_FOUND");
  v1::WaitJobRequest request = WaitFor(server.Create(), 1);
  request.mutable_timeout()->set_seconds(-1);
  status = Ask(server, &Stub::WaitJob, request, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(ViolationOf(status), "timeout");
  request.mutable_timeout()->set_seconds(0);
  request.set_view(static_cast<v1::JobView>(7));
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::WaitJob, request, &job)), "view");
}

TEST(WaitJob, EndsWithItsCaller) {
  RpcTestServer server(WaitForCancel());
  const std::string name = server.Create();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(50));
  v1::Job job;
  EXPECT_EQ(server.stub().WaitJob(&context, WaitFor(name, 60), &job).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
}

TEST(ReadResult, InPiecesAndOverAgain) {
  std::string uv;
  for (int i = 0; i < 700'000; ++i) uv += std::to_string(i % 7) + "x";
  RpcTestServer server(Succeed(1, uv));
  v1::ReadResultRequest request;
  request.set_name(server.Create());
  v1::Job job;
  ASSERT_TRUE(Ask(server, &Stub::WaitJob, WaitFor(request.name(), 60), &job).ok());

  v1::ReadResultResponse piece;
  std::string read;
  do {
    request.set_offset(static_cast<std::int64_t>(read.size()));
    ASSERT_TRUE(Ask(server, &Stub::ReadResult, request, &piece).ok());
    EXPECT_EQ(piece.uv().uv_sha256(), Sha256(uv));
    EXPECT_LE(piece.data().size(), std::size_t{1} << 20);
    read += piece.data();
  } while (!piece.data().empty());
  EXPECT_TRUE(read == uv);

  request.set_offset(10);
  request.set_limit(5);
  ASSERT_TRUE(Ask(server, &Stub::ReadResult, request, &piece).ok());
  EXPECT_EQ(piece.data(), uv.substr(10, 5));
  request.set_offset(static_cast<std::int64_t>(uv.size()) + 1);
  grpc::Status status = Ask(server, &Stub::ReadResult, request, &piece);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(InfoOf(status).reason(), "UV_OFFSET_OUT_OF_RANGE");
  EXPECT_EQ(InfoOf(status).metadata().at("total_bytes"), std::to_string(uv.size()));
  request.set_offset(-1);
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::ReadResult, request, &piece)), "offset");
  request.set_offset(0);
  request.set_limit(-1);
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::ReadResult, request, &piece)), "limit");
}

TEST(ReadResult, OnlyOfJobsThatSucceeded) {
  RpcTestServer server(WaitForCancel());
  v1::ReadResultRequest request;
  v1::ReadResultResponse piece;
  const auto reason = [&] {
    const grpc::Status status = Ask(server, &Stub::ReadResult, request, &piece);
    return std::to_string(status.error_code()) + " " + InfoOf(status).reason();
  };
  request.set_name("jobs/none");
  EXPECT_EQ(reason(), "5 JOB_NOT_FOUND");
  request.set_name(server.Create());
  EXPECT_EQ(reason(), "9 JOB_NOT_FINISHED");
  v1::CancelJobRequest cancel;
  cancel.set_name(request.name());
  v1::Job job;
  ASSERT_TRUE(Ask(server, &Stub::CancelJob, cancel, &job).ok());
  EXPECT_TRUE(job.cancel_requested());
  ASSERT_TRUE(Ask(server, &Stub::WaitJob, WaitFor(request.name(), 60), &job).ok());
  EXPECT_EQ(reason(), "9 NO_RESULT");
}

TEST(Views, BasicHasNoReport) {
  RpcTestServer server(Succeed(1, "uv"));
  v1::GetJobRequest request;
  request.set_name(server.Create());
  v1::Job job;
  ASSERT_TRUE(Ask(server, &Stub::WaitJob, WaitFor(request.name(), 60), &job).ok());
  ASSERT_TRUE(Ask(server, &Stub::GetJob, request, &job).ok());
  EXPECT_TRUE(job.has_report());
  request.set_view(v1::JOB_VIEW_BASIC);
  ASSERT_TRUE(Ask(server, &Stub::GetJob, request, &job).ok());
  EXPECT_FALSE(job.has_report());
  EXPECT_EQ(job.uv().total_bytes(), 2);
  v1::ListJobsRequest list;
  v1::ListJobsResponse page;
  ASSERT_TRUE(Ask(server, &Stub::ListJobs, list, &page).ok());
  EXPECT_FALSE(page.jobs(0).has_report());
  list.set_view(v1::JOB_VIEW_FULL);
  ASSERT_TRUE(Ask(server, &Stub::ListJobs, list, &page).ok());
  EXPECT_TRUE(page.jobs(0).has_report());
  list.set_filter("labels");
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::ListJobs, list, &page)), "filter");
}

// ---- batches

v1::BatchCreateJobsRequest BatchOf(const std::vector<std::string>& meshes) {
  v1::BatchCreateJobsRequest batch;
  for (const std::string& mesh : meshes) {
    v1::CreateJobRequest* request = batch.add_requests();
    request->mutable_spec()->set_draco(mesh);
    request->set_request_id("id of " + mesh);
  }
  return batch;
}

TEST(BatchCreateJobs, EachByItself) {
  JobManagerOptions options;
  options.limits.queue_capacity = 1;
  RpcTestServer server(WaitForCancel(), options);
  v1::BatchCreateJobsRequest batch = BatchOf({"a", "", "b", "c"});
  v1::BatchCreateJobsResponse answer;
  ASSERT_TRUE(Ask(server, &Stub::BatchCreateJobs, batch, &answer).ok());
  ASSERT_EQ(answer.results_size(), 4);
  EXPECT_EQ(answer.results(0).job().state(), v1::JOB_STATE_QUEUED);
  google::rpc::ErrorInfo info;
  const google::rpc::Status& missing = answer.results(1).error();
  ASSERT_TRUE(missing.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "MESH_MISSING");
  google::rpc::BadRequest bad;
  ASSERT_TRUE(missing.details(1).UnpackTo(&bad));
  EXPECT_EQ(bad.field_violations(0).field(), "requests[1].spec.draco");
  EXPECT_FALSE(bad.field_violations(0).description().empty());
  EXPECT_EQ(answer.results(2).job().state(), v1::JOB_STATE_QUEUED);
  const google::rpc::Status& full = answer.results(3).error();
  ASSERT_TRUE(full.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "QUEUE_FULL");
  google::rpc::RetryInfo retry;
  EXPECT_TRUE(full.details(1).UnpackTo(&retry));

  v1::BatchCreateJobsResponse again;
  ASSERT_TRUE(Ask(server, &Stub::BatchCreateJobs, batch, &again).ok());
  EXPECT_EQ(again.results(0).job().name(), answer.results(0).job().name()) << "the same request ids, the same jobs";
  EXPECT_EQ(again.results(2).job().name(), answer.results(2).job().name());
}

TEST(BatchCreateJobs, NeitherNoneNorTooMany) {
  RpcTestServer server(WaitForCancel());
  v1::BatchCreateJobsResponse answer;
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::BatchCreateJobs, BatchOf({}), &answer)), "requests");
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::BatchCreateJobs, BatchOf(std::vector<std::string>(1001, "a")), &answer)),
            "requests");
}

TEST(FindMissingMeshes, WhatIsThereNeedNotBeSent) {
  RpcTestServer server(WaitForCancel());
  server.Create();  // of "mesh"
  v1::FindMissingMeshesRequest request;
  for (const std::string mesh : {"other", "mesh", "third", "other"}) request.add_sha256(Sha256(mesh));
  v1::FindMissingMeshesResponse answer;
  ASSERT_TRUE(Ask(server, &Stub::FindMissingMeshes, request, &answer).ok());
  EXPECT_THAT(answer.missing_sha256(), ::testing::ElementsAre(Sha256("other"), Sha256("third")));

  v1::CreateJobRequest create;
  create.mutable_spec()->set_mesh_sha256(Sha256("mesh"));
  v1::Job job;
  ASSERT_TRUE(Ask(server, &Stub::CreateJob, create, &job).ok());
  EXPECT_EQ(job.mesh_bytes(), 4);
  EXPECT_NE(job.result_of(), "") << "it is the same mesh";
  create.mutable_spec()->set_mesh_sha256(Sha256("other"));
  grpc::Status status = Ask(server, &Stub::CreateJob, create, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(InfoOf(status).reason(), "MESH_NOT_FOUND");
  create.mutable_spec()->set_mesh_sha256("short");
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::CreateJob, create, &job)), "spec.mesh_sha256");
  request.add_sha256("short");
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::FindMissingMeshes, request, &answer)), "sha256");
}

TEST(CreateUpload, TheSameRequestIdIsTheSameUpload) {
  RpcTestServer server(WaitForCancel());
  v1::CreateUploadRequest request;
  request.set_total_bytes(4);
  request.set_sha256(Sha256("mesh"));
  request.set_request_id("once");
  v1::Upload first, second;
  ASSERT_TRUE(Ask(server, &Stub::CreateUpload, request, &first).ok());
  ASSERT_TRUE(Ask(server, &Stub::CreateUpload, request, &second).ok());
  EXPECT_EQ(second.name(), first.name());
  request.set_total_bytes(5);
  const grpc::Status status = Ask(server, &Stub::CreateUpload, request, &second);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(InfoOf(status).reason(), "REQUEST_ID_REUSED");
  request.set_request_id(std::string(129, 'x'));
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::CreateUpload, request, &second)), "request_id");
}

// ---- arrays, and the fields of a spec

v1::JobSpec SquareArrays() {
  const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
  v1::JobSpec spec;
  spec.mutable_arrays()->mutable_positions()->assign(reinterpret_cast<const char*>(positions), sizeof positions);
  spec.mutable_arrays()->mutable_triangles()->assign(reinterpret_cast<const char*>(triangles), sizeof triangles);
  return spec;
}

JobManagerOptions RealEstimates() {
  JobManagerOptions options;
  options.estimate = [](std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                        const v1::UnwrapOptions& unwrap) -> absl::StatusOr<JobNeeds> {
    const absl::StatusOr<WorkNeeds> needs = EstimateNeeds(draco, mesh_bytes, size, unwrap);
    if (!needs.ok()) return needs.status();
    return JobNeeds{needs->size, needs->memory_bytes, needs->run_seconds};
  };
  return options;
}

// What is declared is reserved.
TEST(DeclaredCounts, MustFitIntoTheBytes) {
  const auto mesh = [](std::int64_t faces, std::size_t bytes) {
    std::string draco("DRACO\x02\x02\x01\x01\x00\x00\x00", 12);  // Edgebreaker
    for (std::int64_t count : {faces / 2 + 2, faces}) {
      for (; count >= 128; count >>= 7) draco.push_back(static_cast<char>(0x80 | (count & 127)));
      draco.push_back(static_cast<char>(count));
    }
    draco.resize(bytes, '\0');
    return draco;
  };
  const auto needs = [](const std::string& draco, std::int64_t whole = 0) {
    return EstimateNeeds(draco, whole, v1::MeshSize(), v1::UnwrapOptions());
  };
  const absl::Status refused = needs(mesh(13'000'000, 30)).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument) << refused;
  EXPECT_EQ(ErrorInfoOf(refused).reason, "MESH_DECODE_FAILED");
  EXPECT_TRUE(needs(mesh(13'000'000, 30), 10'000).ok()) << "the first bytes of a file of so many";
  const auto accepted = needs(mesh(980'000, 311));  // as Draco makes it of a million triangles in one point
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  EXPECT_EQ(accepted->size.triangles(), 980'000);
}

TEST(MeshArrays, CountTowardsTheLimitsOfAMesh) {
  JobManagerOptions options = RealEstimates();
  options.max_triangles = 2;
  options.max_mesh_bytes = 72;
  RpcTestServer server(Succeed(1, "uv"), options);
  v1::CreateJobRequest request;
  *request.mutable_spec() = SquareArrays();
  v1::Job job;
  ASSERT_TRUE(Ask(server, &Stub::CreateJob, request, &job).ok());
  EXPECT_EQ(job.mesh_bytes(), 72);
  EXPECT_GT(job.memory_bytes(), 0);

  request.mutable_spec()->mutable_elements()->set_seam_corners(std::string(4, '\0'));
  grpc::Status status = Ask(server, &Stub::CreateJob, request, &job);
  EXPECT_EQ(InfoOf(status).reason(), "MESH_TOO_LARGE");
  EXPECT_EQ(InfoOf(status).metadata().at("bytes"), "76");
  request.mutable_spec()->clear_elements();
  v1::MeshArrays* arrays = request.mutable_spec()->mutable_arrays();
  arrays->mutable_positions()->resize(36);
  arrays->mutable_triangles()->append(std::string(12, '\0'));
  status = Ask(server, &Stub::CreateJob, request, &job);
  EXPECT_EQ(InfoOf(status).reason(), "MESH_TOO_LARGE");
  EXPECT_EQ(InfoOf(status).metadata().at("triangles"), "3");

  v1::EstimateJobRequest estimate;
  *estimate.mutable_spec() = SquareArrays();
  v1::JobEstimate answer;
  ASSERT_TRUE(Ask(server, &Stub::EstimateJob, estimate, &answer).ok());
  EXPECT_EQ(answer.size().triangles(), 2);
  EXPECT_EQ(answer.size().vertices(), 4);
  EXPECT_GT(answer.run_time().nanos(), 0);
}

TEST(BadRequests, NameThePathOfTheField) {
  JobManagerOptions options = RealEstimates();
  options.validate_options = [](const v1::UnwrapOptions& unwrap) {
    return unwrap.padding() > 64
               ? MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID", "bad", {{"field", "padding"}})
               : absl::OkStatus();
  };
  RpcTestServer server(Succeed(1, "uv"), options);
  const auto violation = [&](const std::function<void(v1::CreateJobRequest*)>& change) {
    v1::CreateJobRequest request;
    *request.mutable_spec() = SquareArrays();
    change(&request);
    v1::Job job;
    const grpc::Status status = Ask(server, &Stub::CreateJob, request, &job);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(InfoOf(status).metadata().count("field"), 1u);
    return ViolationOf(status);
  };
  using Request = v1::CreateJobRequest;
  EXPECT_EQ(violation([](Request* r) { r->clear_spec(); }), "spec.mesh");
  EXPECT_EQ(violation([](Request* r) { r->mutable_spec()->set_draco("no mesh"); }), "spec.draco");
  EXPECT_EQ(violation([](Request* r) { r->mutable_spec()->mutable_arrays()->mutable_positions()->pop_back(); }),
            "spec.arrays.positions");
  EXPECT_EQ(violation([](Request* r) { r->mutable_spec()->mutable_arrays()->clear_triangles(); }),
            "spec.arrays.triangles");
  EXPECT_EQ(violation([](Request* r) { r->mutable_spec()->mutable_options()->set_padding(65); }),
            "spec.options.padding");
  EXPECT_EQ(violation([](Request* r) { r->mutable_spec()->mutable_elements()->set_seam_corners("\xff\xff\xff\xff"); }),
            "spec.elements.seam_corners");
  EXPECT_EQ(violation([](Request* r) { r->mutable_spec()->mutable_scheduling()->mutable_timeout(); }),
            "spec.scheduling.timeout");
  EXPECT_EQ(violation([](Request* r) { (*r->mutable_spec()->mutable_labels())["No"] = ""; }), "spec.labels");
  EXPECT_EQ(violation([](Request* r) { r->set_request_id(std::string(129, 'x')); }), "request_id");
  v1::EstimateJobRequest estimate;
  v1::JobEstimate answer;
  EXPECT_EQ(ViolationOf(Ask(server, &Stub::EstimateJob, estimate, &answer)), "spec.mesh");
}

}  // namespace
}  // namespace planish
