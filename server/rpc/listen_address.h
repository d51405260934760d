// An address to listen on: "HOST:PORT" (port 0: any) or "unix:PATH".
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

struct ListenAddress {
  std::string text;       // as given, for people
  std::string unix_path;  // empty for TCP
  std::string grpc;       // the address in gRPC's form
};

// Parses an address. INVALID_ARGUMENT with a message that names `text`.
absl::StatusOr<ListenAddress> ParseListenAddress(const std::string& text);

// Whether only this machine can reach the address.
bool IsLocal(const ListenAddress& address);

// Removes a socket file at `path` on which no server answers. ALREADY_EXISTS if a server answers or the file is not a
// socket. No effect if there is no such file.
absl::Status RemoveStaleSocket(const std::string& path);

// Tries to listen on `address` and returns why the system refuses it, e.g. "Address already in use"; "unknown reason"
// if it does not.
std::string WhyNotListening(const ListenAddress& address);

// Owns a socket file. The destructor removes it, unless another server has replaced it since.
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
