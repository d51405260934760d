#include "server/rpc/call.h"

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "grpcpp/support/proto_buffer_reader.h"
#include "grpcpp/support/slice.h"
#include "server/link/rpc_status.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/wire_scan.h"

namespace planish {
namespace {

// Memory that a call takes of gRPC's quota in addition to its messages: its arena, its headers, and the bytes that its
// stream may send before they are read.
constexpr std::int64_t kCallBytes = std::int64_t{128} << 10;

// Memory that a parsed message may take: kMostGrowth times its bytes, plus a constant. Enough for numbers, and for a
// full batch of jobs with full sets of labels.
constexpr std::int64_t kMostGrowth = 3;
constexpr std::int64_t kMostFieldBytes = std::int64_t{16} << 20;

grpc::ByteBuffer ToBytes(const std::string& bytes) {
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

grpc::ByteBuffer ToBytes(const google::protobuf::Message& message) {
  const std::size_t size = message.ByteSizeLong();
  const grpc::Slice slice(grpc_slice_malloc(size), grpc::Slice::STEAL_REF);
  message.SerializeWithCachedSizesToArray(const_cast<std::uint8_t*>(slice.begin()));
  return grpc::ByteBuffer(&slice, 1);
}

// `bytes`: the length of the message; 0 if unknown, since reading was stopped.
absl::Status TooLong(const Method& method, std::int64_t bytes, std::int64_t limit) {
  const std::string message =
      absl::StrCat("the message is too long: ", std::string(method.name), " takes at most ", limit, " bytes");
  std::map<std::string, std::string> metadata = {{"limit", absl::StrCat(limit)}};
  if (bytes > 0) metadata["bytes"] = absl::StrCat(bytes);
  if (method.size == MessageSize::kJob) {
    return MakeError(absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE", message, std::move(metadata));
  }
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, std::move(metadata));
}

}  // namespace

void TellCallEnd(const CallSurroundings& surroundings, const Method* method, const absl::Status& status,
                 absl::Duration duration) {
  if (!surroundings.on_end) return;
  EndedCall ended;
  ended.call = method == nullptr ? "OTHER" : std::string(method->name);
  ended.code = status.code();
  if (!status.ok()) ended.reason = ReasonOf(ToRpcStatus(status));
  if (HidesPaths(status)) ended.hidden = std::string(status.message());
  ended.duration = duration;
  ended.streams = method != nullptr && method->streams;
  ended.submits = method != nullptr && method->submits;
  surroundings.on_end(ended);
}

absl::Status ReceivedMessage::Parse(google::protobuf::Message* message) {
  bool parsed = false;
  {
    grpc::ProtoBufferReader reader(&bytes_);
    parsed = reader.status().ok() && message->ParseFromZeroCopyStream(&reader);
  }
  bytes_.Clear();
  incoming_ = MessageMemory::Share();
  return parsed ? absl::OkStatus() : NoSuchMessage(message->GetDescriptor());
}

std::string ReceivedMessage::TakeBytes() {
  std::vector<grpc::Slice> slices;
  std::string bytes;
  if (bytes_.Dump(&slices).ok()) {
    for (const grpc::Slice& slice : slices) bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  }
  bytes_.Clear();
  return bytes;
}

// Everybody can make calls that need no credentials, so these get no room of their own in the quota.
Call::Call(CallInfo info) : info_(std::move(info)), peer_(info_.context->peer()) {
  if (is_anonymous()) return;
  room_ = info_.surroundings->memory->Expect(kCallBytes);
  info_.surroundings->watch->AddCall(peer_);
}

Call::~Call() {
  if (!is_anonymous()) info_.surroundings->watch->RemoveCall(peer_);
}

Call* Call::Begin(std::shared_ptr<Call> call) {
  Call* const reactor = call.get();
  reactor->self_ = call;  // `call` keeps the object alive to the end of this function
  reactor->Read();
  reactor->OnBegin();
  return reactor;
}

void Call::Read() {
  const std::int64_t limit = info_.surroundings->limits.MaxBytes(*info_.method);
  if (!is_anonymous()) expected_ = info_.surroundings->memory->Expect(limit);
  const std::lock_guard lock(starting_);
  reading_ = true;
  info_.surroundings->watch->Begin(this, peer_, limit, [weak = weak_from_this()] {
    if (const auto alive = weak.lock()) alive->StopReading();
  });
  StartRead(&incoming_);
}

void Call::StopReading() {
  {
    const std::lock_guard lock(starting_);  // waits for Read() to return: gRPC accepts no read after the end
  }
  if (!reading_.exchange(false)) return;
  const std::int64_t limit = info_.surroundings->limits.MaxBytes(*info_.method);
  OnRefused(TooLong(*info_.method, 0, limit));
}

void Call::OnReadDone(bool ok) {
  info_.surroundings->watch->End(this, peer_, ok ? static_cast<std::int64_t>(incoming_.Length()) : 0);
  if (!reading_.exchange(false)) {
    incoming_.Clear();
    return;
  }
  if (!ok) {
    expected_ = MessageMemory::Share();
    return OnNoMessage();
  }
  has_message_ = true;
  absl::StatusOr<ReceivedMessagePtr> message = Check();
  if (message.ok()) return OnMessage(*std::move(message));
  incoming_.Clear();
  expected_ = MessageMemory::Share();
  OnRefused(message.status());
}

void Call::OnNoMessage() {
  if (has_message_) return;
  End(MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", "the call has no message"));
}

absl::StatusOr<ReceivedMessagePtr> Call::Check() {
  const Method& method = *info_.method;
  const auto bytes = static_cast<std::int64_t>(incoming_.Length());
  const std::int64_t limit = info_.surroundings->limits.MaxBytes(method);
  if (bytes > limit) return TooLong(method, bytes, limit);
  WireCost cost;
  {
    grpc::ProtoBufferReader reader(&incoming_);
    PLANISH_RETURN_IF_ERROR(absl::Status(reader.status().ok() ? absl::OkStatus() : NoSuchMessage(method.request())));
    PLANISH_ASSIGN_OR_RETURN(cost, ScanMessage(&reader, bytes, method.request(), method.max_fields));
  }
  if (cost.bytes > kMostGrowth * bytes + kMostFieldBytes) {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                     absl::StrCat("the message would take ", cost.bytes >> 20, " MiB of memory for its ", bytes,
                                  " bytes: it has too many entries"));
  }
  PLANISH_ASSIGN_OR_RETURN(MessageMemory::Share parsed,
                           info_.surroundings->memory->Take(info_.caller.tenant, cost.bytes));
  grpc::ByteBuffer taken;
  taken.Swap(&incoming_);
  return std::make_shared<ReceivedMessage>(std::move(taken), std::move(expected_), std::move(parsed));
}

void Call::OnDone() {
  OnEnd();
  self_.reset();
}

void Call::Send(const google::protobuf::Message& message) {
  outgoing_ = ToBytes(message);
  StartWrite(&outgoing_);
}

void Call::SendBytes(const std::string& bytes) {
  outgoing_ = ToBytes(bytes);
  StartWrite(&outgoing_);
}

void Call::End(const absl::Status& status) {
  if (MayEnd(status)) Finish(ToGrpcStatus(status));
}

void Call::EndWith(const google::protobuf::Message& message) {
  if (!MayEnd(absl::OkStatus())) return;
  outgoing_ = ToBytes(message);
  StartWriteAndFinish(&outgoing_, grpc::WriteOptions(), grpc::Status::OK);
}

void Call::EndBare(const grpc::Status& status) {
  if (MayEnd(absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message()))) Finish(status);
}

bool Call::MayEnd(const absl::Status& status) {
  if (ended_.exchange(true)) return false;
  // Health checks and reflection are not counted.
  if (!is_anonymous()) {
    TellCallEnd(*info_.surroundings, info_.method, status, absl::Now() - start_);
  }
  return true;
}

}  // namespace planish
