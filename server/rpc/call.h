// How the bytes of a call become messages: who calls is known before the first one is read, and how long it is and how
// many fields it has before it is parsed.
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
  std::string reason;  // in the ErrorInfo of its error; empty: none
  std::string hidden;  // the message of its error, if its caller was not told all of it (ToCallStatus); else empty
  absl::Duration duration;
  bool streams = false;  // as Method
  bool submits = false;
};

// Hears how each call of this server's own services ended. Called on gRPC's threads and those of handlers: must be
// quick and thread-safe.
using CallListener = std::function<void(const EndedCall&)>;

// A message that was received, and its shares of the memory for messages.
class ReceivedMessage {
 public:
  ReceivedMessage(grpc::ByteBuffer bytes, MessageMemory::Share incoming, MessageMemory::Share parsed)
      : bytes_(std::move(bytes)), incoming_(std::move(incoming)), parsed_(std::move(parsed)) {}

  // Once; then the bytes are gone. INVALID_ARGUMENT as NoSuchMessage(). `message` must not outlive this object.
  absl::Status Parse(google::protobuf::Message* message);
  // The message as it came, once; for messages without a descriptor.
  std::string TakeBytes();

 private:
  grpc::ByteBuffer bytes_;
  MessageMemory::Share incoming_;
  MessageMemory::Share parsed_;
};
using ReceivedMessagePtr = std::shared_ptr<ReceivedMessage>;

// What calls share. All of it outlives them.
struct CallSurroundings {
  MessageMemory* memory;
  ReadWatch* watch;
  MethodLimits limits;
  CallListener on_end;  // null: nobody listens
};

// Tells `surroundings.on_end`; `method` is null if this server has no such method.
void TellCallEnd(const CallSurroundings& surroundings, const Method* method, const absl::Status& status,
                 absl::Duration duration);

// An admitted call.
struct CallInfo {
  const Method* method;
  grpc::CallbackServerContext* context;  // as long as the call
  Caller caller;                         // nobody where Method.need is kNobody
  const CallSurroundings* surroundings;
};

// gRPC's side of a call of any shape. Owns itself from Begin() until gRPC is done with it. Between a Read() and what
// comes of it there is no other Read().
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

  // The first message has been asked for.
  virtual void OnBegin() {}
  // Asks for the next message. The caller keeps this object alive.
  void Read();
  // It has come, and is short enough. On one of gRPC's threads: must be quick.
  virtual void OnMessage(ReceivedMessagePtr message) = 0;
  // There is no other message: the caller has ended its side or is gone. By default the
  // call ends with an error if it sent none.
  virtual void OnNoMessage();
  // A message is refused. By default the call ends with `status`.
  virtual void OnRefused(const absl::Status& status) { End(status); }
  // The call is over; `this` may go.
  virtual void OnEnd() {}

  // Sends a message; OnWriteDone() tells when the next one may be sent.
  void Send(const google::protobuf::Message& message);
  void SendBytes(const std::string& bytes);
  // Ends the call; once ended it stays as it ended. `this` may be gone when it returns.
  void End(const absl::Status& status);
  // The same after one last message.
  void EndWith(const google::protobuf::Message& message);
  // With a status of gRPC's own making.
  void EndBare(const grpc::Status& status);

 private:
  absl::StatusOr<ReceivedMessagePtr> Check();
  // Ends the read that is under way, on any thread.
  void StopReading();
  bool is_anonymous() const { return info_.method->need == Need::kNobody; }
  // False if the call was ended before.
  bool MayEnd(const absl::Status& status);

  const CallInfo info_;
  const absl::Time start_ = absl::Now();
  const std::string peer_;
  std::atomic<bool> ended_ = false;
  std::mutex starting_;                // held while a read is started
  std::atomic<bool> reading_ = false;  // set by Read(), cleared by the first that ends the read
  bool has_message_ = false;           // has had any; touched between reads
  grpc::ByteBuffer incoming_;
  MessageMemory::Share expected_;
  grpc::ByteBuffer outgoing_;
  MessageMemory::Share room_;  // for the call itself

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
