#include "server/rpc/reflection.h"

#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "google/protobuf/descriptor.h"
#include "google/protobuf/descriptor.pb.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/io/zero_copy_stream_impl_lite.h"
#include "google/protobuf/wire_format_lite.h"

namespace planish {
namespace {

using google::protobuf::DescriptorPool;
using google::protobuf::FieldDescriptor;
using google::protobuf::FileDescriptor;
using google::protobuf::internal::WireFormatLite;

// Limits the streams, since a caller that does not read leaves an answer of some tens of kilobytes in memory.
constexpr int kMostReflections = 32;

// Numbers of fields in grpc/reflection/v1alpha/reflection.proto, for which Debian has no generated code.
enum RequestField {
  kHost = 1,
  kFileByFilename = 3,
  kFileContainingSymbol = 4,
  kFileContainingExtension = 5,  // containing_type = 1, extension_number = 2
  kAllExtensionNumbersOfType = 6,
  kListServices = 7,
};
enum ResponseField {
  kValidHost = 1,
  kOriginalRequest = 2,
  kFileDescriptorResponse = 4,       // file_descriptor_proto = 1
  kAllExtensionNumbersResponse = 5,  // base_type_name = 1, extension_number = 2
  kListServicesResponse = 6,         // service = 1, name = 1
  kErrorResponse = 7,                // error_code = 1, error_message = 2
};

struct ReflectionRequest {
  std::string host;
  int field = 0;  // number of the field that is set; 0: none
  std::string value;
};

// Builds a message from its fields.
class WireWriter {
 public:
  void Text(int number, const std::string& value) {
    google::protobuf::io::StringOutputStream stream(&bytes_);
    google::protobuf::io::CodedOutputStream out(&stream);
    WireFormatLite::WriteBytes(number, value, &out);
  }
  void Number(int number, int value) {
    google::protobuf::io::StringOutputStream stream(&bytes_);
    google::protobuf::io::CodedOutputStream out(&stream);
    WireFormatLite::WriteInt32(number, value, &out);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Calls `take` with each field of the message `bytes`. False if they are not a message.
template <class Take>
bool ForFields(const std::string& bytes, const Take& take) {
  google::protobuf::io::CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                            static_cast<int>(bytes.size()));
  while (const std::uint32_t tag = in.ReadTag()) {
    std::string value;
    const bool is_text = WireFormatLite::GetTagWireType(tag) == WireFormatLite::WIRETYPE_LENGTH_DELIMITED;
    std::uint64_t number = 0;
    const bool is_number = WireFormatLite::GetTagWireType(tag) == WireFormatLite::WIRETYPE_VARINT;
    const bool read = is_text     ? WireFormatLite::ReadBytes(&in, &value)
                      : is_number ? in.ReadVarint64(&number)
                                  : WireFormatLite::SkipField(&in, tag);
    if (!read) return false;
    if (is_text || is_number) take(WireFormatLite::GetTagFieldNumber(tag), std::move(value), number);
  }
  return true;
}

std::optional<ReflectionRequest> ReadReflectionRequest(const std::string& bytes) {
  ReflectionRequest request;
  const bool read = ForFields(bytes, [&](int field, std::string value, std::uint64_t) {
    if (field == kHost) request.host = std::move(value);
    if (field >= kFileByFilename && field <= kListServices) {
      request.field = field;
      request.value = std::move(value);
    }
  });
  return read ? std::make_optional(std::move(request)) : std::nullopt;
}

void AddFile(const FileDescriptor& file, std::set<std::string>* seen, WireWriter* answer) {
  if (!seen->insert(file.name()).second) return;
  google::protobuf::FileDescriptorProto proto;
  file.CopyTo(&proto);
  answer->Text(1, proto.SerializeAsString());
  for (int i = 0; i < file.dependency_count(); ++i) AddFile(*file.dependency(i), seen, answer);
}

const FileDescriptor* FileOfExtension(const DescriptorPool& pool, const std::string& question) {
  std::string type_name;
  int number = 0;
  ForFields(question, [&](int field, std::string value, std::uint64_t varint) {
    if (field == 1) type_name = std::move(value);
    if (field == 2) number = static_cast<int>(varint);
  });
  const google::protobuf::Descriptor* type = pool.FindMessageTypeByName(type_name);
  const FieldDescriptor* extension = type == nullptr ? nullptr : pool.FindExtensionByNumber(type, number);
  return extension == nullptr ? nullptr : extension->file();
}

// The answer to `request`: the number of the response's field, and its contents.
std::pair<ResponseField, std::string> AnswerTo(const ReflectionRequest& request,
                                               const std::vector<std::string>& services) {
  const DescriptorPool& pool = *DescriptorPool::generated_pool();
  WireWriter answer;
  const auto error = [&answer](grpc::StatusCode code, const std::string& message) {
    answer.Number(1, code);
    if (!message.empty()) answer.Text(2, message);
    return std::pair(kErrorResponse, answer.bytes());
  };
  const auto file = [&](const FileDescriptor* found, const std::string& missing) {
    if (found == nullptr) return error(grpc::StatusCode::NOT_FOUND, missing);
    std::set<std::string> seen;
    AddFile(*found, &seen, &answer);
    return std::pair(kFileDescriptorResponse, answer.bytes());
  };
  switch (request.field) {
    case kFileByFilename:
      return file(pool.FindFileByName(request.value), "File not found.");
    case kFileContainingSymbol:
      return file(pool.FindFileContainingSymbol(request.value), "Symbol not found.");
    case kFileContainingExtension:
      return file(FileOfExtension(pool, request.value), "Extension not found.");
    case kAllExtensionNumbersOfType: {
      const google::protobuf::Descriptor* type = pool.FindMessageTypeByName(request.value);
      if (type == nullptr) return error(grpc::StatusCode::NOT_FOUND, "Type not found.");
      std::vector<const FieldDescriptor*> extensions;
      pool.FindAllExtensions(type, &extensions);
      answer.Text(1, request.value);
      for (const FieldDescriptor* extension : extensions) answer.Number(2, extension->number());
      return {kAllExtensionNumbersResponse, answer.bytes()};
    }
    case kListServices:
      for (const std::string& name : services) {
        WireWriter service;
        service.Text(1, name);
        answer.Text(1, service.bytes());
      }
      return {kListServicesResponse, answer.bytes()};
    default:
      return error(grpc::StatusCode::UNIMPLEMENTED, "");
  }
}

}  // namespace

// A stream of questions, which are answered one at a time.
class ReflectionService::Stream : public Call {
 public:
  Stream(CallInfo call, ReflectionService* service) : Call(std::move(call)), service_(*service) { ++service_.streams_; }
  ~Stream() override { --service_.streams_; }

  void OnWriteDone(bool ok) override { ok ? Read() : EndBare(grpc::Status::CANCELLED); }

 private:
  void OnBegin() override {
    if (service_.streams_ > kMostReflections) {
      EndBare({grpc::StatusCode::RESOURCE_EXHAUSTED, "too many calls of reflection at a time"});
    }
  }

  void OnMessage(ReceivedMessagePtr message) override {
    const std::string bytes = message->TakeBytes();
    const std::optional<ReflectionRequest> request = ReadReflectionRequest(bytes);
    if (!request.has_value()) return EndBare({grpc::StatusCode::INVALID_ARGUMENT, "could not parse request"});
    const auto [field, answer] = AnswerTo(*request, service_.services_);
    WireWriter response;
    if (!request->host.empty()) response.Text(kValidHost, request->host);
    response.Text(kOriginalRequest, bytes);
    response.Text(field, answer);
    SendBytes(response.bytes());
  }

  void OnNoMessage() override { EndBare(grpc::Status::OK); }

  ReflectionService& service_;
};

ReflectionService::ReflectionService(std::vector<std::string> services) : services_(std::move(services)) {
  endpoints_.push_back({&MethodAt("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"),
                        [this](CallInfo info) { return std::make_shared<Stream>(std::move(info), this); }});
}

}  // namespace planish
