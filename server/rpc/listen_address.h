// Where a server listens: "HOST:PORT" (port 0: any) or "unix:PATH".
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

struct ListenAddress {
  std::string text;       // as given, for people
  std::string unix_path;  // empty for TCP
  std::string grpc;       // as gRPC wants it
};

// INVALID_ARGUMENT with a message that names `text`.
absl::StatusOr<ListenAddress> ParseListenAddress(const std::string& text);

// Whether only this machine can reach it.
bool IsLocal(const ListenAddress& address);

// Makes way for a socket at `path`: removes a socket file that nobody answers on. ALREADY_EXISTS if a server answers
// or the file is something else. No effect if there is no such file.
absl::Status RemoveStaleSocket(const std::string& path);

// Why the system refuses to listen on `address`, e.g. "Address already in use"; found by trying. "unknown reason" if
// it does not refuse.
std::string WhyNotListening(const ListenAddress& address);

// A socket file that is removed with this object, unless another server has put its own there since.
class SocketFile {
 public:
  explicit SocketFile(const std::string& path);
  ~SocketFile();
  SocketFile(const SocketFile&) = delete;
  SocketFile& operator=(const SocketFile&) = delete;

 private:
  const std::string path_;
  unsigned long long device_ = 0;
  unsigned long long inode_ = 0;
};

}  // namespace planish
