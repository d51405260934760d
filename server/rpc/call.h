// Receives the messages of a call. The caller is known before the first message is read, and the length and the number
// of fields are checked before a message is parsed.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "google/protobuf/message.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/byte_buffer.h"
#include "grpcpp/support/server_callback.h"
#include "server/access/caller.h"
#include "server/rpc/message_memory.h"
#include "server/rpc/methods.h"
#include "server/rpc/read_watch.h"

namespace planish {

struct EndedCall {
  std::string call;  // the method's name, e.g. "CreateJob"; "OTHER" if this server has no such method
  absl::StatusCode code = absl::StatusCode::kOk;
  std::string reason;  // the reason of the call's error; empty: none
  // The full message of the call's error, if ToCallStatus() withheld part of it from the caller; else empty.
  std::string hidden;
  absl::Duration duration;
  bool streams = false;  // as in Method
  bool submits = false;
};

// Called at the end of each call of this server's own services, on gRPC's threads and those of handlers: must be quick
// and thread-safe.
using CallListener = std::function<void(const EndedCall&)>;

// A received message, and its shares of the memory for messages.
class ReceivedMessage {
 public:
  ReceivedMessage(grpc::ByteBuffer bytes, MessageMemory::Share incoming, MessageMemory::Share parsed)
      : bytes_(std::move(bytes)), incoming_(std::move(incoming)), parsed_(std::move(parsed)) {}

  // Parses the bytes and frees them; call it once. The error of NoSuchMessage() if they cannot be parsed. `message`
  // must not outlive this object.
  absl::Status Parse(google::protobuf::Message* message);
  // The unparsed bytes, for messages without a descriptor; call it once.
  std::string TakeBytes();

 private:
  grpc::ByteBuffer bytes_;
  MessageMemory::Share incoming_;
  MessageMemory::Share parsed_;
};
using ReceivedMessagePtr = std::shared_ptr<ReceivedMessage>;

// What all calls share. The objects outlive all calls.
struct CallSurroundings {
  MessageMemory* memory;
  ReadWatch* watch;
  MethodLimits limits;
  CallListener on_end;  // may be null
};

// Calls `surroundings.on_end`. `method` is null if this server has no such method.
void TellCallEnd(const CallSurroundings& surroundings, const Method* method, const absl::Status& status,
                 absl::Duration duration);

// An admitted call.
struct CallInfo {
  const Method* method;
  grpc::CallbackServerContext* context;  // valid as long as the call
  Caller caller;                         // empty if Method.need is kNobody
  const CallSurroundings* surroundings;
};

// The base class of a call of any kind. Owns itself from Begin() until gRPC has finished with it. A Read() must have
// completed before the next one.
class Call : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
             public std::enable_shared_from_this<Call> {
 public:
  explicit Call(CallInfo info);
  ~Call() override;

  // Reads the first message.
  static Call* Begin(std::shared_ptr<Call> call);

  void OnReadDone(bool ok) final;
  void OnDone() final;

 protected:
  const CallInfo& info() const { return info_; }

  // Called after the first read was started.
  virtual void OnBegin() {}
  // Starts to read the next message. The caller of this function must keep the object alive.
  void Read();
  // A message was received and is within the limits. Called on one of gRPC's threads: must be quick.
  virtual void OnMessage(ReceivedMessagePtr message) = 0;
  // No more messages follow: the caller has ended its side or is gone. By default the call ends with an error if there
  // was no message at all.
  virtual void OnNoMessage();
  // A message was refused. By default the call ends with `status`.
  virtual void OnRefused(const absl::Status& status) { End(status); }
  // The call has ended; `this` may be destroyed afterwards.
  virtual void OnEnd() {}

  // Sends a message. The next one may be sent after OnWriteDone().
  void Send(const google::protobuf::Message& message);
  void SendBytes(const std::string& bytes);
  // Ends the call. No effect if it has already ended. `this` may be gone when it returns.
  void End(const absl::Status& status);
  // Sends one last message and ends the call with OK.
  void EndWith(const google::protobuf::Message& message);
  // Ends the call with a status as gRPC would make it, without details.
  void EndBare(const grpc::Status& status);

 private:
  absl::StatusOr<ReceivedMessagePtr> Check();
  // Refuses the message that is being read as too long. May be called on any thread.
  void StopReading();
  bool is_anonymous() const { return info_.method->need == Need::kNobody; }
  // Marks the call as ended, and tells the listener. False if it had already ended.
  bool MayEnd(const absl::Status& status);

  const CallInfo info_;
  const absl::Time start_ = absl::Now();
  const std::string peer_;
  std::atomic<bool> ended_ = false;
  std::mutex starting_;                // held while a read is started
  std::atomic<bool> reading_ = false;  // set by Read(), cleared by whatever ends the read first
  bool has_message_ = false;           // at least one message was received; used between reads only
  grpc::ByteBuffer incoming_;
  MessageMemory::Share expected_;
  grpc::ByteBuffer outgoing_;
  MessageMemory::Share room_;  // memory for the call itself

  std::shared_ptr<Call> self_;  // set by Begin(), dropped by OnDone()
};

// Makes the call of one method.
using CallMaker = std::function<std::shared_ptr<Call>(CallInfo)>;

struct Endpoint {
  const Method* method;
  CallMaker make;
};

// A service, which must outlive the RpcServer's Shutdown().
class RpcService {
 public:
  virtual ~RpcService() = default;
  virtual const std::vector<Endpoint>& endpoints() const = 0;
};

}  // namespace planish
