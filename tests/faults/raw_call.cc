#include "tests/faults/raw_call.h"

#include <chrono>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/support/byte_buffer.h"

namespace planish {
namespace {

std::string ReasonOf(const grpc::Status& status) {
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return "";
  google::rpc::ErrorInfo info;
  for (const auto& detail : details.details()) {
    if (detail.UnpackTo(&info)) return info.reason();
  }
  return "";
}

}  // namespace

RawCall::RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method, const std::string& request,
                 double limit_seconds)
    : RawCall(channel, "/planish.v1.Planish/" + method, grpc::Slice(request), {limit_seconds, "", GRPC_COMPRESS_NONE}) {
}

RawCall::RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& path, const grpc::Slice& request,
                 const RawCallOptions& options)
    : stub_(channel) {
  context_.set_deadline(std::chrono::system_clock::now() +
                        std::chrono::milliseconds(static_cast<std::int64_t>(1000 * options.limit_seconds)));
  if (!options.token.empty()) context_.AddMetadata("authorization", "Bearer " + options.token);
  if (options.compression != GRPC_COMPRESS_NONE) context_.set_compression_algorithm(options.compression);
  call_ = stub_.PrepareCall(&context_, path, &queue_);
  call_->StartCall(this);
  if (!Wait()) return;
  call_->WriteLast(grpc::ByteBuffer(&request, 1), grpc::WriteOptions(), this);
  Wait();
}

RawCall::~RawCall() {
  if (!finished_) Finish();
  queue_.Shutdown();
  void* tag;
  bool ok;
  while (queue_.Next(&tag, &ok)) {
  }
}

bool RawCall::Wait() {
  void* tag;
  bool ok = false;
  return queue_.Next(&tag, &ok) && ok;
}

std::optional<std::string> RawCall::Read() {
  grpc::ByteBuffer buffer;
  call_->Read(&buffer, this);
  if (!Wait()) {
    ended_ = true;
    return std::nullopt;
  }
  std::vector<grpc::Slice> slices;
  buffer.Dump(&slices).ok();
  std::string bytes;
  for (const grpc::Slice& slice : slices) bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return bytes;
}

CallEnd RawCall::Finish() {
  if (!ended_) context_.TryCancel();
  finished_ = true;
  grpc::Status status;
  call_->Finish(&status, this);
  Wait();
  return {status.error_code(), ReasonOf(status), status.error_message()};
}

}  // namespace planish
