#include "server/rpc/health.h"

#include <optional>
#include <utility>

#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/wire_format_lite.h"

namespace planish {
namespace {

using google::protobuf::internal::WireFormatLite;

// Debian has no generated code for these messages. Each has one field, with the number 1.
constexpr std::uint32_t kServiceTag = WireFormatLite::MakeTag(1, WireFormatLite::WIRETYPE_LENGTH_DELIMITED);
constexpr std::uint32_t kStatusTag = WireFormatLite::MakeTag(1, WireFormatLite::WIRETYPE_VARINT);

constexpr std::size_t kMostServiceName = 200;

// The field `service` of a HealthCheckRequest; nullopt if the message cannot be parsed or the name is too long.
std::optional<std::string> RequestedService(ReceivedMessage& message) {
  const std::string bytes = message.TakeBytes();
  google::protobuf::io::CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                            static_cast<int>(bytes.size()));
  std::string service;
  while (const std::uint32_t tag = in.ReadTag()) {
    const bool read =
        tag == kServiceTag ? WireFormatLite::ReadBytes(&in, &service) : WireFormatLite::SkipField(&in, tag);
    if (!read) return std::nullopt;
  }
  if (service.size() > kMostServiceName) return std::nullopt;
  return service;
}

std::string HealthResponse(HealthService::Status status) {
  return {static_cast<char>(kStatusTag), static_cast<char>(status)};
}

grpc::Status CannotParse(grpc::StatusCode code) {
  return {code, "could not parse request"};
}

}  // namespace

class HealthService::Check : public Call {
 public:
  Check(CallInfo call, HealthService* service) : Call(std::move(call)), service_(*service) {}

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    const std::optional<std::string> name = RequestedService(*message);
    if (!name.has_value()) return EndBare(CannotParse(grpc::StatusCode::INVALID_ARGUMENT));
    const Status status = service_.Find(*name);
    if (status == Status::kServiceUnknown) return EndBare({grpc::StatusCode::NOT_FOUND, "service name unknown"});
    SendBytes(HealthResponse(status));
  }

  void OnWriteDone(bool) override { EndBare(grpc::Status::OK); }

  HealthService& service_;
};

class HealthService::Watch : public Call {
 public:
  Watch(CallInfo call, HealthService* service) : Call(std::move(call)), service_(*service) {}

  void Tell(Status status) {
    const std::lock_guard lock(mutex_);
    next_ = status;
    SendNext();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    is_sending_ = false;
    if (ok) return SendNext();
    next_.reset();
    EndBare(grpc::Status::CANCELLED);
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    next_.reset();
    is_sending_ = true;  // for good, so that nothing more is sent
    EndBare(grpc::Status::CANCELLED);
  }

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    std::optional<std::string> name = RequestedService(*message);
    if (!name.has_value()) return EndBare(CannotParse(grpc::StatusCode::INTERNAL));
    name_ = *std::move(name);
    service_.Add(name_, Self());
  }

  void OnEnd() override { service_.Remove(name_, Self()); }

  std::shared_ptr<Watch> Self() { return std::static_pointer_cast<Watch>(shared_from_this()); }

  // Sends the newest change, unless a message is being sent. Requires mutex_.
  void SendNext() {
    if (!next_.has_value() || is_sending_) return;
    is_sending_ = true;
    SendBytes(HealthResponse(*std::exchange(next_, std::nullopt)));
  }

  HealthService& service_;
  std::string name_;  // set by OnMessage()

  std::mutex mutex_;
  // Guarded by mutex_.
  std::optional<Status> next_;  // the newest change that was not sent yet
  bool is_sending_ = false;
};

HealthService::HealthService() {
  statuses_[""] = Status::kServing;
  endpoints_.push_back({&MethodAt("/grpc.health.v1.Health/Check"),
                        [this](CallInfo info) { return std::make_shared<Check>(std::move(info), this); }});
  endpoints_.push_back({&MethodAt("/grpc.health.v1.Health/Watch"),
                        [this](CallInfo info) { return std::make_shared<Watch>(std::move(info), this); }});
}

void HealthService::Set(const std::string& service, bool is_serving) {
  const std::lock_guard lock(mutex_);
  const Status status = is_serving ? Status::kServing : Status::kNotServing;
  statuses_[service] = status;
  for (const auto& watch : watches_[service]) watch->Tell(status);
}

HealthService::Status HealthService::Find(const std::string& service) {
  const std::lock_guard lock(mutex_);
  const auto found = statuses_.find(service);
  return found == statuses_.end() ? Status::kServiceUnknown : found->second;
}

void HealthService::Add(const std::string& service, const std::shared_ptr<Watch>& watch) {
  const std::lock_guard lock(mutex_);
  const auto found = statuses_.find(service);
  watches_[service].insert(watch);
  watch->Tell(found == statuses_.end() ? Status::kServiceUnknown : found->second);
}

void HealthService::Remove(const std::string& service, const std::shared_ptr<Watch>& watch) {
  const std::lock_guard lock(mutex_);
  const auto found = watches_.find(service);
  if (found == watches_.end()) return;
  found->second.erase(watch);
  if (found->second.empty()) watches_.erase(found);
}

}  // namespace planish
