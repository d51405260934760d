// Uploads over the wire, and jobs made from them.
#include <random>
#include <thread>

#include "core/base/sha256.h"
#include "gtest/gtest.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

std::string Noise(std::size_t size) {
  std::mt19937 random(7);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

// Succeeds with the digest of the mesh as UV.
WorkerScript Digest() {
  return [](ServerLink& link, const ServerLink::Received& received) {
    SendSuccess(link, Sha256(std::string(received.blobs.at(0)->bytes())));
    return true;
  };
}

class UploadsRpc : public ::testing::Test {
 protected:
  v1::Upload Create(const std::string& bytes) {
    v1::CreateUploadRequest request;
    request.set_total_bytes(static_cast<std::int64_t>(bytes.size()));
    request.set_sha256(Sha256(bytes));
    v1::Upload upload;
    grpc::ClientContext context;
    EXPECT_TRUE(server_.stub().CreateUpload(&context, request, &upload).ok());
    return upload;
  }

  struct Piece {
    std::string name;
    std::int64_t offset;
    std::string data;
  };

  // A call with these messages, and its answer.
  grpc::Status Write(const std::vector<Piece>& pieces, v1::Upload* answer) {
    grpc::ClientContext context;
    const auto writer = server_.stub().WriteUpload(&context, answer);
    for (const Piece& piece : pieces) {
      v1::WriteUploadRequest request;
      request.set_name(piece.name);
      request.set_offset(piece.offset);
      request.set_data(piece.data);
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }
  grpc::Status Write(const std::vector<Piece>& pieces) {
    v1::Upload answer;
    return Write(pieces, &answer);
  }

  grpc::Status Get(const std::string& name, v1::Upload* upload) {
    v1::GetUploadRequest request;
    request.set_name(name);
    grpc::ClientContext context;
    return server_.stub().GetUpload(&context, request, upload);
  }

  Received Unwrap(const std::string& upload) {
    v1::UnwrapRequest request;
    request.mutable_spec()->set_upload(upload);
    grpc::ClientContext context;
    return ReceiveAll(server_.stub().Unwrap(&context, request).get());
  }

  RpcTestServer server_{Digest()};
};

TEST_F(UploadsRpc, ListsWhatIsUnderWay) {
  const v1::Upload first = Create("first"), second = Create("second");
  ASSERT_TRUE(Write({{second.name(), 0, "second"}}).ok());
  ASSERT_TRUE(Write({{first.name(), 0, "fi"}}).ok());
  grpc::ClientContext context;
  v1::ListUploadsResponse list;
  ASSERT_TRUE(server_.stub().ListUploads(&context, {}, &list).ok());
  ASSERT_EQ(list.uploads_size(), 1);
  EXPECT_EQ(list.uploads(0).name(), first.name());
  EXPECT_EQ(list.uploads(0).committed_bytes(), 2);
}

TEST_F(UploadsRpc, InPiecesOverSeveralCallsToAJob) {
  const std::string mesh = Noise(200'000);
  const std::string name = Create(mesh).name();
  v1::Upload upload;
  EXPECT_TRUE(Write({{name, 0, mesh.substr(0, 50'000)}, {"", 50'000, mesh.substr(50'000, 1)}}, &upload).ok());
  EXPECT_EQ(upload.committed_bytes(), 50'001);
  {
    grpc::ClientContext context;  // a caller that vanishes
    const auto writer = server_.stub().WriteUpload(&context, &upload);
    v1::WriteUploadRequest request;
    request.set_name(name);
    request.set_offset(50'001);
    request.set_data(mesh.substr(50'001, 50'000));
    EXPECT_TRUE(writer->Write(request));
    while (Get(name, &upload).ok() && upload.committed_bytes() == 50'001) std::this_thread::yield();
    context.TryCancel();
    EXPECT_FALSE(writer->Finish().ok());
  }
  EXPECT_EQ(Unwrap(name).status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(InfoOf(Unwrap(name).status).reason(), "UPLOAD_INCOMPLETE");
  EXPECT_EQ(InfoOf(Unwrap(name).status).metadata().at("committed_bytes"), "100001");

  grpc::Status status = Write({{name, 100'001, mesh.substr(100'001, 60'000)}, {name, 160'001, mesh.substr(160'001)}});
  while (status.error_code() == grpc::StatusCode::ABORTED) {  // until the server noticed that the caller vanished
    EXPECT_EQ(InfoOf(status).reason(), "UPLOAD_BUSY");
    status = Write({{name, 100'001, mesh.substr(100'001, 60'000)}, {name, 160'001, mesh.substr(160'001)}});
  }
  EXPECT_TRUE(status.ok()) << status.error_message();

  const Received received = Unwrap(name);
  EXPECT_TRUE(received.status.ok()) << received.status.error_message();
  EXPECT_EQ(received.uv, Sha256(mesh)) << "the worker got the very bytes";
  EXPECT_EQ(received.LastJob().mesh_bytes(), 200'000);
  EXPECT_EQ(Create(mesh).committed_bytes(), 200'000) << "known bytes need not come again";

  v1::CreateJobRequest create;
  create.mutable_spec()->set_upload(name);
  grpc::ClientContext context;
  v1::Job job;
  EXPECT_TRUE(server_.stub().CreateJob(&context, create, &job).ok());
  EXPECT_EQ(job.mesh_bytes(), 200'000);
}

TEST_F(UploadsRpc, ErrorsHaveReasons) {
  const auto check = [](const grpc::Status& status, grpc::StatusCode code, const std::string& reason) {
    EXPECT_EQ(status.error_code(), code) << reason;
    EXPECT_EQ(InfoOf(status).reason(), reason);
  };
  const std::string mesh = Noise(1000);
  const std::string name = Create(mesh).name();
  v1::Upload upload;
  check(Get("uploads/none", &upload), grpc::StatusCode::NOT_FOUND, "UPLOAD_NOT_FOUND");
  check(Write({{"uploads/none", 0, "x"}}), grpc::StatusCode::NOT_FOUND, "UPLOAD_NOT_FOUND");
  check(Write({}), grpc::StatusCode::INVALID_ARGUMENT, "REQUEST_INVALID");
  check(Write({{"", 0, "x"}}), grpc::StatusCode::INVALID_ARGUMENT, "REQUEST_INVALID");
  check(Write({{name, 0, "x"}, {"uploads/other", 1, "x"}}), grpc::StatusCode::INVALID_ARGUMENT, "REQUEST_INVALID");
  check(Write({{name, 0, std::string((64 << 10) + 1, 'x')}}), grpc::StatusCode::INVALID_ARGUMENT, "REQUEST_INVALID");
  const grpc::Status gap = Write({{name, 5, "x"}});
  check(gap, grpc::StatusCode::OUT_OF_RANGE, "UPLOAD_OFFSET_MISMATCH");
  EXPECT_EQ(InfoOf(gap).metadata().at("committed_bytes"), "1") << "one byte came above";
  check(Write({{name, 0, std::string(1000, 'x')}}), grpc::StatusCode::INVALID_ARGUMENT, "DIGEST_MISMATCH");
  check(Get(name, &upload), grpc::StatusCode::NOT_FOUND, "UPLOAD_NOT_FOUND");
  check(Unwrap("uploads/none").status, grpc::StatusCode::NOT_FOUND, "UPLOAD_NOT_FOUND");

  v1::DeleteUploadRequest erase;
  google::protobuf::Empty empty;
  erase.set_name(Create("abc").name());
  grpc::ClientContext first, second;
  EXPECT_TRUE(server_.stub().DeleteUpload(&first, erase, &empty).ok());
  check(server_.stub().DeleteUpload(&second, erase, &empty), grpc::StatusCode::NOT_FOUND, "UPLOAD_NOT_FOUND");
}

TEST_F(UploadsRpc, TwoWritersOneUpload) {
  const std::string mesh = Noise(100);
  const std::string name = Create(mesh).name();
  grpc::ClientContext context;
  v1::Upload upload;
  const auto first = server_.stub().WriteUpload(&context, &upload);
  v1::WriteUploadRequest request;
  request.set_name(name);
  request.set_data(mesh.substr(0, 10));
  EXPECT_TRUE(first->Write(request));
  while (Get(name, &upload).ok() && upload.committed_bytes() < 10) std::this_thread::yield();
  const grpc::Status busy = Write({{name, 10, "x"}});
  EXPECT_EQ(busy.error_code(), grpc::StatusCode::ABORTED);
  EXPECT_EQ(InfoOf(busy).reason(), "UPLOAD_BUSY");
  first->WritesDone();
  EXPECT_TRUE(first->Finish().ok());
  EXPECT_TRUE(Write({{name, 10, mesh.substr(10)}}).ok()) << "the first one is gone when its caller knows";
}

// CANCELLED, which gRPC may say by itself, would mean that the caller gave up: it would not go on elsewhere.
TEST_F(UploadsRpc, ShutdownTellsOpenUploadsToGoOnElsewhere) {
  const std::string mesh = Noise(100);
  const std::string name = Create(mesh).name();
  grpc::ClientContext context;
  v1::Upload upload;
  const auto writer = server_.stub().WriteUpload(&context, &upload);
  v1::WriteUploadRequest request;
  request.set_name(name);
  request.set_data(mesh.substr(0, 10));
  EXPECT_TRUE(writer->Write(request));
  v1::Upload so_far;
  while (Get(name, &so_far).ok() && so_far.committed_bytes() < 10) std::this_thread::yield();
  server_.streams().InterruptSenders();
  const grpc::Status cut = writer->Finish();
  EXPECT_EQ(cut.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(InfoOf(cut).reason(), "DRAINING");
  EXPECT_TRUE(HasRetryInfo(cut));
  EXPECT_TRUE(Get(name, &so_far).ok());
  EXPECT_EQ(so_far.committed_bytes(), 10) << "nothing is lost, and the upload is free for another writer";
  const grpc::Status late = Write({{name, 10, mesh.substr(10)}});
  EXPECT_EQ(InfoOf(late).reason(), "DRAINING") << "a call that comes later is told the same";
}

}  // namespace
}  // namespace planish
