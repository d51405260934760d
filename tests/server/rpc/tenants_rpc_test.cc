// What a caller gets to know over the wire of jobs and uploads of other tenants: nothing.
#include <functional>
#include <string>
#include <vector>

#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Callers say who they are: metadata "tenant", and "rights" where these are not submit and jobs.
class SaidCallerSource : public CallerSource {
 public:
  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const override {
    const auto said = [&](const char* key) {
      const auto found = context.client_metadata().find(key);
      return found == context.client_metadata().end() ? "" : std::string(found->second.data(), found->second.size());
    };
    return Caller{said("tenant"), "token " + said("tenant"), {true, said("rights") != "submit", false, false}, ""};
  }
};

class TenantsRpcTest : public ::testing::Test {
 protected:
  TenantsRpcTest()
      : server_(WaitForCancel(), {}, {}, 1e9, std::make_unique<SaidCallerSource>()), stub_(server_.stub()) {}

  static std::unique_ptr<grpc::ClientContext> As(const std::string& tenant, const std::string& rights = "") {
    auto context = std::make_unique<grpc::ClientContext>();
    context->AddMetadata("tenant", tenant);
    if (!rights.empty()) context->AddMetadata("rights", rights);
    return context;
  }

  std::string CreateJob(const std::string& tenant) {
    v1::CreateJobRequest request;
    request.mutable_spec()->set_draco("mesh");
    v1::Job job;
    EXPECT_TRUE(stub_.CreateJob(As(tenant).get(), request, &job).ok());
    EXPECT_EQ(job.tenant(), tenant);
    return job.name();
  }

  // Code, message and details of every call about the job; the name in them is put as NAME.
  std::string Answers(const std::string& tenant, const std::string& name) {
    std::vector<grpc::Status> statuses;
    const auto ask = [&](auto request, const auto& call) {
      request.set_name(name);
      statuses.push_back(call(As(tenant).get(), request));
    };
    v1::Job job;
    google::protobuf::Empty nothing;
    ask(v1::GetJobRequest(), [&](auto* context, auto& request) { return stub_.GetJob(context, request, &job); });
    ask(v1::WaitJobRequest(), [&](auto* context, auto& request) { return stub_.WaitJob(context, request, &job); });
    v1::ReadResultResponse piece;
    ask(v1::ReadResultRequest(),
        [&](auto* context, auto& request) { return stub_.ReadResult(context, request, &piece); });
    ask(v1::StopJobRequest(), [&](auto* context, auto& request) { return stub_.StopJob(context, request, &job); });
    ask(v1::CancelJobRequest(), [&](auto* context, auto& request) { return stub_.CancelJob(context, request, &job); });
    ask(v1::DeleteJobRequest(),
        [&](auto* context, auto& request) { return stub_.DeleteJob(context, request, &nothing); });
    for (const bool attach : {false, true}) {
      for (const bool include_uv : {false, true}) {
        v1::WatchJobRequest watch;
        watch.set_attach(attach);
        watch.set_include_uv(include_uv);
        ask(watch, [&](auto* context, auto& request) {
          const Received received = ReceiveAll(stub_.WatchJob(context, request).get());
          EXPECT_THAT(received.events, IsEmpty());
          return received.status;
        });
      }
    }
    std::string all;
    for (const grpc::Status& status : statuses) {
      EXPECT_FALSE(status.ok());
      all += std::to_string(status.error_code()) + status.error_message() + status.error_details();
    }
    for (std::size_t at = all.find(name); at != std::string::npos; at = all.find(name)) {
      all.replace(at, name.size(), "NAME");
    }
    return all;
  }

  RpcTestServer server_;
  v1::Planish::Stub& stub_;
};

TEST_F(TenantsRpcTest, AForeignJobIsNoneByteForByte) {
  const std::string name = CreateJob("ann");
  const std::string never = "jobs/0123456789abcdef";
  ASSERT_EQ(name.size(), never.size());
  EXPECT_EQ(Answers("bob", name), Answers("bob", never));
  EXPECT_THAT(Answers("bob", name), HasSubstr("JOB_NOT_FOUND"));
  v1::GetJobRequest request;
  request.set_name(name);
  v1::Job job;
  ASSERT_TRUE(stub_.GetJob(As("ann").get(), request, &job).ok());
  EXPECT_FALSE(job.stop_requested());
}

TEST_F(TenantsRpcTest, AForeignUploadIsNoneByteForByte) {
  v1::CreateUploadRequest create;
  create.set_total_bytes(4);
  create.set_sha256(Sha256("mesh"));
  v1::Upload upload;
  ASSERT_TRUE(stub_.CreateUpload(As("ann").get(), create, &upload).ok());
  const auto answers = [&](std::string name) {
    std::string all;
    const auto note = [&](const grpc::Status& status) {
      EXPECT_FALSE(status.ok());
      all += std::to_string(status.error_code()) + status.error_message() + status.error_details();
    };
    v1::GetUploadRequest get;
    get.set_name(name);
    v1::Upload got;
    note(stub_.GetUpload(As("bob").get(), get, &got));
    v1::DeleteUploadRequest erase;
    erase.set_name(name);
    google::protobuf::Empty nothing;
    note(stub_.DeleteUpload(As("bob").get(), erase, &nothing));
    v1::CreateJobRequest use;
    use.mutable_spec()->set_upload(name);
    v1::Job job;
    note(stub_.CreateJob(As("bob").get(), use, &job));
    const auto context = As("bob");
    const auto writer = stub_.WriteUpload(context.get(), &got);
    v1::WriteUploadRequest write;
    write.set_name(name);
    write.set_data("mesh");
    writer->Write(write);
    writer->WritesDone();
    note(writer->Finish());
    for (std::size_t at = all.find(name); at != std::string::npos; at = all.find(name)) {
      all.replace(at, name.size(), "NAME");
    }
    return all;
  };
  const std::string never = "uploads/0123456789abcdef";
  ASSERT_EQ(upload.name().size(), never.size());
  EXPECT_EQ(answers(upload.name()), answers(never));
  EXPECT_THAT(answers(never), HasSubstr("UPLOAD_NOT_FOUND"));
}

TEST_F(TenantsRpcTest, WhoMayOnlySubmitSeesAndEndsItsOwnUnwrap) {
  v1::UnwrapRequest request;
  request.mutable_spec()->set_draco("mesh");
  const auto context = As("farm", "submit");
  const auto reader = stub_.Unwrap(context.get(), request);
  v1::UnwrapResponse response;
  ASSERT_TRUE(reader->Read(&response));
  const std::string name = response.event().job().name();
  v1::Job job;
  v1::GetJobRequest get;
  get.set_name(name);
  EXPECT_EQ(InfoOf(stub_.GetJob(As("farm", "submit").get(), get, &job)).reason(), "RIGHT_MISSING");
  v1::CancelJobRequest cancel;
  cancel.set_name(name);
  EXPECT_EQ(InfoOf(stub_.CancelJob(As("other", "submit").get(), cancel, &job)).reason(), "JOB_NOT_FOUND");
  EXPECT_TRUE(stub_.CancelJob(As("farm", "submit").get(), cancel, &job).ok());
  EXPECT_EQ(ReceiveAll(reader.get()).LastJob().state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(TenantsRpcTest, CapabilitiesAreTheCallersOwn) {
  v1::Capabilities capabilities;
  ASSERT_TRUE(stub_.GetCapabilities(As("ann").get(), v1::GetCapabilitiesRequest(), &capabilities).ok());
  EXPECT_EQ(capabilities.queue_capacity(), JobLimits().queue_capacity);
}

}  // namespace
}  // namespace planish
