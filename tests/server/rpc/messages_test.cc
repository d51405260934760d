// How bytes become messages: what is looked at before, and what is refused.
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "google/protobuf/io/zero_copy_stream_impl_lite.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "server/rpc/message_memory.h"
#include "server/rpc/methods.h"
#include "server/rpc/wire_scan.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::MessageFactory;
using ::testing::HasSubstr;

constexpr char kService[] = "/planish.v1.Planish/";
constexpr std::int64_t kManyFields = std::int64_t{1} << 30;

absl::StatusOr<WireCost> Scan(const std::string& bytes, const google::protobuf::Descriptor* type,
                              std::int64_t max_fields = kManyFields) {
  google::protobuf::io::ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()), /*block_size=*/7);
  return ScanMessage(&stream, static_cast<std::int64_t>(bytes.size()), type, max_fields);
}

// The methods of planish.v1, with their descriptors.
std::vector<const google::protobuf::MethodDescriptor*> AllMethods() {
  const auto* service = v1::GetJobRequest::descriptor()->file()->FindServiceByName("Planish");
  std::vector<const google::protobuf::MethodDescriptor*> methods;
  for (int i = 0; i < service->method_count(); ++i) methods.push_back(service->method(i));
  return methods;
}

// What a call with these bytes ends with.
grpc::Status CallWith(RpcTestServer& server, const std::string& path, const std::string& request) {
  grpc::GenericStub stub(server.channel());
  grpc::CompletionQueue queue;
  grpc::ClientContext context;
  const auto wait = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  const auto call = stub.PrepareCall(&context, path, &queue);
  call->StartCall(nullptr);
  wait();
  const grpc::Slice slice(request);
  call->WriteLast(grpc::ByteBuffer(&slice, 1), grpc::WriteOptions(), nullptr);
  wait();
  grpc::ByteBuffer answer;
  for (bool more = true; more;) {
    call->Read(&answer, nullptr);
    more = wait();
  }
  grpc::Status status;
  call->Finish(&status, nullptr);
  wait();
  return status;
}

TEST(Methods, TheTableHasEveryMethodOfTheServices) {
  for (const auto* method : AllMethods()) {
    const Method& row = MethodAt(kService + method->name());
    EXPECT_EQ(row.request(), method->input_type());
    EXPECT_EQ(row.streams, method->client_streaming() || method->server_streaming() || method->name() == "WaitJob")
        << method->name();
  }
}

TEST(Messages, MalformedOnesAreInvalidArguments) {
  RpcTestServer server(WaitForCancel());
  for (const auto* method : AllMethods()) {
    for (const std::string bytes : {"\x07", "\x0a\xff\xff\xff\xff\x07", "\x0b\x0b\x0b", "\xff"}) {
      const grpc::Status status = CallWith(server, kService + method->name(), bytes);
      EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << method->name();
      EXPECT_EQ(InfoOf(status).reason(), "REQUEST_INVALID") << method->name();
      EXPECT_THAT(status.error_message(), HasSubstr(method->input_type()->full_name()));
    }
  }
  const std::string not_utf8 = "\x0a\x02\xc3\x28";
  EXPECT_EQ(CallWith(server, "/planish.v1.Planish/GetJob", not_utf8).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(Messages, UnknownMethodsStayUnimplemented) {
  RpcTestServer server(WaitForCancel());
  const grpc::Status status = CallWith(server, "/planish.v1.Planish/Nothing", "x");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(status.error_message(), "");
}

TEST(Messages, TooManyFieldsAreRefusedUnparsed) {
  RpcTestServer server(WaitForCancel());
  for (const auto* method : AllMethods()) {
    const std::int64_t most = MethodAt(kService + method->name()).max_fields;
    std::string bytes;
    for (std::int64_t i = 0; i <= most; ++i)
      bytes += std::string("\xf8\x07\x01", 3);  // field 127, which no request has
    const grpc::Status status = CallWith(server, kService + method->name(), bytes);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << method->name();
    EXPECT_THAT(status.error_message(), HasSubstr("more than " + std::to_string(most) + " fields")) << method->name();
  }
}

TEST(Messages, TooLongOnesAreRefusedUnparsed) {
  RpcTestServer server(WaitForCancel());
  for (const auto* method : AllMethods()) {
    const bool is_job = MethodAt(kService + method->name()).size == MessageSize::kJob;
    if (is_job || method->client_streaming()) continue;
    const grpc::Status status =
        CallWith(server, kService + method->name(), "\x0a\x80\x80\x08" + std::string(1 << 17, 'x'));
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << method->name();
    EXPECT_THAT(status.error_message(), HasSubstr("takes at most 65536 bytes")) << method->name();
  }
}

TEST(Messages, ACallWithoutAMessageIsInvalid) {
  RpcTestServer server(WaitForCancel());
  grpc::GenericStub stub(server.channel());
  grpc::CompletionQueue queue;
  grpc::ClientContext context;
  const auto wait = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  const auto call = stub.PrepareCall(&context, "/planish.v1.Planish/GetJob", &queue);
  call->StartCall(nullptr);
  wait();
  call->WritesDone(nullptr);
  wait();
  grpc::Status status;
  call->Finish(&status, nullptr);
  wait();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

// ---- NUL bytes

// Sets every string field of `message`, at every depth, in turn, and calls `see` with the field's path.
void ForStrings(Message* root, Message* message, const std::string& path,
                const std::function<void(const std::string&)>& see) {
  const google::protobuf::Descriptor& type = *message->GetDescriptor();
  const auto& reflection = *message->GetReflection();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor* field = type.field(i);
    const std::string name = path + field->name();
    const std::string text("a\0b", 3);
    if (field->is_map()) {
      Message* entry = reflection.AddMessage(message, field);
      const FieldDescriptor* value = entry->GetDescriptor()->FindFieldByName("value");
      if (value->type() == FieldDescriptor::TYPE_STRING) {
        entry->GetReflection()->SetString(entry, value, text);
        see(name);
      }
    } else if (field->message_type() != nullptr) {
      Message* inner =
          field->is_repeated() ? reflection.AddMessage(message, field) : reflection.MutableMessage(message, field);
      ForStrings(root, inner, name + (field->is_repeated() ? "[0]." : "."), see);
    } else if (field->type() == FieldDescriptor::TYPE_STRING) {
      field->is_repeated() ? reflection.AddString(message, field, text) : reflection.SetString(message, field, text);
      see(name);
    } else {
      continue;
    }
    reflection.ClearField(message, field);
  }
}

TEST(Messages, NulIsInvalidInEveryStringOfEveryRequest) {
  RpcTestServer server(WaitForCancel());
  int strings = 0;
  for (const auto* method : AllMethods()) {
    const std::unique_ptr<Message> request(
        MessageFactory::generated_factory()->GetPrototype(method->input_type())->New());
    ForStrings(request.get(), request.get(), "", [&](const std::string& path) {
      ++strings;
      const grpc::Status status = CallWith(server, kService + method->name(), request->SerializeAsString());
      EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << method->name() << " " << path;
      EXPECT_EQ(ViolationOf(status), path) << method->name();
    });
  }
  EXPECT_GT(strings, 20);
}

// ---- what parsing takes

TEST(WireScan, CountsFieldsAtEveryDepth) {
  v1::BatchCreateJobsRequest batch;
  for (int i = 0; i < 3; ++i) (*batch.add_requests()->mutable_spec()->mutable_labels())["key"] = "value";
  const auto cost = Scan(batch.SerializeAsString(), batch.GetDescriptor());
  ASSERT_TRUE(cost.ok()) << cost.status();
  EXPECT_EQ(cost->fields, 3 * 5);  // a request, its spec, a label, its key and value
  EXPECT_TRUE(Scan(batch.SerializeAsString(), batch.GetDescriptor(), 15).ok());
  EXPECT_FALSE(Scan(batch.SerializeAsString(), batch.GetDescriptor(), 14).ok());
}

// Fills fields of all kinds, repeated ones `count` times.
void Fill(Message* message, int count, int depth) {
  const google::protobuf::Descriptor& type = *message->GetDescriptor();
  const auto& reflection = *message->GetReflection();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor* field = type.field(i);
    for (int k = 0; k < (field->is_repeated() ? count : 1); ++k) {
      if (field->message_type() != nullptr) {
        if (depth > 0) {
          Message* inner =
              field->is_repeated() ? reflection.AddMessage(message, field) : reflection.MutableMessage(message, field);
          Fill(inner, count, depth - 1);
        }
      } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
        const std::string text(static_cast<std::size_t>(k % 40), 'x');
        field->is_repeated() ? reflection.AddString(message, field, text) : reflection.SetString(message, field, text);
      } else if (field->is_repeated() && field->cpp_type() == FieldDescriptor::CPPTYPE_INT32) {
        reflection.AddInt32(message, field, k % 100);
      } else if (field->is_repeated() && field->cpp_type() == FieldDescriptor::CPPTYPE_FLOAT) {
        reflection.AddFloat(message, field, 1);
      }
    }
  }
}

TEST(WireScan, NoMessageTakesMuchMoreThanItsScanSays) {
  for (const auto* method : AllMethods()) {
    for (const int count : {1, 3, 40, 1000}) {
      const std::unique_ptr<Message> request(
          MessageFactory::generated_factory()->GetPrototype(method->input_type())->New());
      Fill(request.get(), count, count > 100 ? 1 : 3);
      const std::string bytes = request->SerializeAsString();
      const auto cost = Scan(bytes, method->input_type());
      ASSERT_TRUE(cost.ok()) << cost.status();
      const std::unique_ptr<Message> parsed(request->New());
      ASSERT_TRUE(parsed->ParseFromString(bytes));
      const std::size_t base = std::unique_ptr<Message>(request->New())->SpaceUsedLong();
      EXPECT_LE(parsed->SpaceUsedLong(), 2 * static_cast<std::size_t>(cost->bytes) + base)
          << method->name() << " " << count;
    }
  }
}

TEST(WireScan, UnknownFieldsCount) {
  std::string bytes;
  for (int i = 0; i < 1000; ++i) bytes += std::string("\xf8\x07\x01\xfa\x07\x01x", 7);
  v1::GetJobRequest request;
  ASSERT_TRUE(request.ParseFromString(bytes));
  const auto cost = Scan(bytes, request.GetDescriptor());
  ASSERT_TRUE(cost.ok());
  EXPECT_EQ(cost->fields, 2000);
  EXPECT_GE(2 * static_cast<std::size_t>(cost->bytes), request.SpaceUsedLong());
}

TEST(WireScan, DeepNestingIsMalformed) {
  std::string bytes;
  for (int i = 0; i < 200; ++i) bytes += "\x0b";
  for (int i = 0; i < 200; ++i) bytes += "\x0c";
  EXPECT_EQ(Scan(bytes, v1::GetJobRequest::descriptor()).status().code(), absl::StatusCode::kInvalidArgument);
}

// ---- memory

TEST(MessageMemory, ATenantTakesNoMoreThanItsPart) {
  MessageMemory memory(1000);
  std::vector<MessageMemory::Share> shares;
  const auto take = [&](const std::string& tenant, std::int64_t bytes) {
    auto share = memory.Take(tenant, bytes);
    if (!share.ok()) return ErrorInfoOf(share.status()).reason;
    shares.push_back(*std::move(share));
    return std::string();
  };
  EXPECT_EQ(take("a", 900), "");
  EXPECT_EQ(take("a", 200), "QUEUE_FULL");
  EXPECT_EQ(take("b", 400), "") << "a tenant that has none gets its part";
  EXPECT_EQ(take("b", 200), "QUEUE_FULL");
  EXPECT_EQ(take("c", 0), "");
  shares.clear();
  EXPECT_EQ(take("a", 1000), "") << "all was given back";
}

TEST(MessageMemory, WithoutALimitEverythingIsTaken) {
  MessageMemory memory(0);
  EXPECT_TRUE(memory.Take("a", std::int64_t{1} << 40).ok());
}

}  // namespace
}  // namespace planish
