// Every refusal that a caller must tell apart, through the library: code, reason, metadata, and whether to come back.
#include <functional>

#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using testing::FakeServer;
using testing::FakeStream;
using testing::FakeUpload;
using testing::MakeStatus;
using testing::StateEvent;
using Status = google::rpc::Status;

const std::vector<float> kCorners = {0, 0, 0, 1, 0, 0, 0, 1, 0};
const std::vector<std::uint32_t> kOneTriangle = {0, 1, 2};

struct Refusal {
  std::string name;
  Status answer;  // of whatever call comes
  ErrorCode code;
  std::string reason;
  Error::Metadata metadata;
  double retry_after = 0;
  bool by_upload = false;
};

class ErrorTable : public ::testing::TestWithParam<Refusal> {
 protected:
  ErrorTable() {
    const Status answer = GetParam().answer;
    server_.on_unwrap = [answer](const v1::UnwrapRequest&, FakeStream&) { return answer; };
    server_.on_watch = [answer](const v1::WatchJobRequest&, FakeStream&) { return answer; };
    server_.on_create = [answer](const v1::CreateJobRequest&, v1::Job&) { return answer; };
    server_.on_job = [answer](const std::string&, const std::string&, v1::Job&) { return answer; };
    server_.on_capabilities = [](v1::Capabilities&) { return Status(); };
    server_.on_create_upload = [](const v1::CreateUploadRequest& request, v1::Upload& upload) {
      upload.set_name("uploads/1");
      upload.set_total_bytes(request.total_bytes());
      return Status();
    };
    server_.on_write_upload = [answer](FakeUpload&, v1::Upload&) { return answer; };
    options_.queue_full_timeout = Seconds(0);
    if (GetParam().by_upload) options_.inline_mesh_bytes = 0;
  }

  void Expect(const std::function<void(Client&)>& call) {
    Client client(server_.target(), options_);
    try {
      call(client);
      ADD_FAILURE() << "nothing was thrown";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), GetParam().code) << error.what();
      EXPECT_EQ(error.reason(), GetParam().reason);
      EXPECT_EQ(error.metadata(), GetParam().metadata);
      EXPECT_NEAR(error.retry_after().count(), GetParam().retry_after, 1e-6);
    }
  }

  ClientOptions options_;
  FakeServer server_;
};

class MeshRefusals : public ErrorTable {};
class JobRefusals : public ErrorTable {};

TEST_P(MeshRefusals, AreTheErrorsOfTheLibrary) {
  Expect([](Client& client) { client.Unwrap({kCorners, kOneTriangle}); });
  Expect([](Client& client) { client.CreateJob({kCorners, kOneTriangle}); });
}

TEST_P(JobRefusals, AreTheErrorsOfTheLibrary) {
  Expect([](Client& client) { client.AttachResult("jobs/1", {kCorners, kOneTriangle}); });
  if (GetParam().reason == "RESULT_EXPIRED") return;
  Expect([](Client& client) { client.WatchJob("jobs/1"); });
  Expect([](Client& client) { client.GetJob("jobs/1"); });
  Expect([](Client& client) { client.StopJob("jobs/1"); });
  Expect([](Client& client) { client.CancelJob("jobs/1"); });
  Expect([](Client& client) { client.DeleteJob("jobs/1"); });
}

Refusal MakeRow(const std::string& name, ErrorCode code, const std::string& reason, const Error::Metadata& metadata,
                double retry_after = 0, bool by_upload = false) {
  return {name,     MakeStatus(static_cast<int>(code), "no", reason, metadata, retry_after),
          code,     reason,
          metadata, retry_after,
          by_upload};
}

std::string NameOf(const ::testing::TestParamInfo<Refusal>& info) {
  return info.param.name;
}

INSTANTIATE_TEST_SUITE_P(
    All, MeshRefusals,
    ::testing::Values(
        MakeRow("QueueFull", ErrorCode::kResourceExhausted, "QUEUE_FULL", {{"queue_capacity", "64"}}, 0.5),
        MakeRow("StorageFull", ErrorCode::kResourceExhausted, "STORAGE_FULL", {}, 0.5),
        MakeRow("MemoryFull", ErrorCode::kResourceExhausted, "MEMORY_LIMIT", {{"bytes", "9"}, {"limit", "8"}}),
        MakeRow("OversizedMesh", ErrorCode::kResourceExhausted, "MESH_TOO_LARGE", {{"bytes", "9"}, {"limit", "8"}}),
        MakeRow("TooManyTriangles", ErrorCode::kResourceExhausted, "MESH_TOO_LARGE",
                {{"triangles", "9"}, {"limit", "8"}}),
        MakeRow("WrongDigest", ErrorCode::kInvalidArgument, "DIGEST_MISMATCH", {{"upload", "uploads/1"}}, 0, true),
        MakeRow("RequestIdReused", ErrorCode::kAlreadyExists, "REQUEST_ID_REUSED", {{"job", "jobs/1"}})),
    NameOf);
INSTANTIATE_TEST_SUITE_P(
    All, JobRefusals,
    ::testing::Values(MakeRow("UnknownJob", ErrorCode::kNotFound, "JOB_NOT_FOUND", {{"job", "jobs/1"}}),
                      MakeRow("ExpiredResult", ErrorCode::kNotFound, "RESULT_EXPIRED", {{"job", "jobs/1"}})),
    NameOf);

}  // namespace
}  // namespace planish
