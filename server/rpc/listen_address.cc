#include "server/rpc/listen_address.h"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/base/target.h"

namespace planish {
namespace {

constexpr char kUnix[] = "unix:";

std::string ErrorText(int error) {
  return std::generic_category().message(error);
}

// A socket that closes itself.
class Socket {
 public:
  Socket(int family, int type) : fd_(socket(family, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {}
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int fd() const { return fd_; }

 private:
  const int fd_;
};

sockaddr_un UnixAddress(const std::string& path) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  return address;
}

// Converts to the kernel's address type for all families.
const sockaddr* Generic(const sockaddr_un& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

int TryTcp(const addrinfo& address) {
  const Socket socket(address.ai_family, SOCK_STREAM);
  if (socket.fd() < 0) return errno;
  const int on = 1;
  setsockopt(socket.fd(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (bind(socket.fd(), address.ai_addr, address.ai_addrlen) != 0) return errno;
  return listen(socket.fd(), 1) != 0 ? errno : 0;
}

}  // namespace

absl::StatusOr<ListenAddress> ParseListenAddress(const std::string& text) {
  ListenAddress address;
  address.text = text;
  if (absl::StartsWith(text, kUnix)) {
    address.unix_path = std::string(absl::StripPrefix(text.substr(sizeof(kUnix) - 1), "//"));
    if (address.unix_path.empty()) return absl::InvalidArgumentError(text + ": no path after unix:");
    if (address.unix_path.size() >= sizeof(sockaddr_un::sun_path)) {
      return absl::InvalidArgumentError(absl::StrCat(text, ": the path of a Unix socket may have at most ",
                                                     sizeof(sockaddr_un::sun_path) - 1, " bytes"));
    }
    address.grpc = kUnix + address.unix_path;
    return address;
  }
  if (!ParseHostPort(text)) {
    return absl::InvalidArgumentError(text + ": expected HOST:PORT, [IPV6]:PORT or unix:PATH");
  }
  address.grpc = text;
  return address;
}

bool IsLocal(const ListenAddress& address) {
  return IsWithinThisMachine(address.grpc);
}

absl::Status RemoveStaleSocket(const std::string& path) {
  struct stat file = {};
  if (lstat(path.c_str(), &file) != 0) return absl::OkStatus();
  if (!S_ISSOCK(file.st_mode)) return absl::AlreadyExistsError(path + " exists and is not a socket");
  const Socket socket(AF_UNIX, SOCK_STREAM);
  const sockaddr_un address = UnixAddress(path);
  if (connect(socket.fd(), Generic(address), sizeof(address)) == 0 || errno == EAGAIN) {
    return absl::AlreadyExistsError(path + ": a server is already listening there");
  }
  if (errno != ECONNREFUSED) return absl::AlreadyExistsError(path + ": " + ErrorText(errno));
  if (unlink(path.c_str()) != 0 && errno != ENOENT) {
    return absl::AlreadyExistsError(path + ": cannot remove the stale socket: " + ErrorText(errno));
  }
  return absl::OkStatus();
}

std::string WhyNotListening(const ListenAddress& address) {
  int error = 0;
  if (!address.unix_path.empty()) {
    const Socket socket(AF_UNIX, SOCK_STREAM);
    const sockaddr_un unix_address = UnixAddress(address.unix_path);
    if (bind(socket.fd(), Generic(unix_address), sizeof(unix_address)) == 0) {
      unlink(address.unix_path.c_str());
    } else {
      error = errno;
    }
  } else {
    const HostPort parts = ParseHostPort(address.text).value_or(HostPort());
    addrinfo hints = {};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_PASSIVE;
    addrinfo* found = nullptr;
    if (const int failure = getaddrinfo(parts.host.c_str(), parts.port.c_str(), &hints, &found); failure != 0) {
      return gai_strerror(failure);
    }
    for (const addrinfo* each = found; each != nullptr && error == 0; each = each->ai_next) error = TryTcp(*each);
    freeaddrinfo(found);
  }
  return error == 0 ? "unknown reason" : ErrorText(error);
}

SocketFile::SocketFile(const std::string& path) : path_(path) {
  struct stat file = {};
  if (stat(path_.c_str(), &file) != 0) return;
  device_ = file.st_dev;
  inode_ = file.st_ino;
}

SocketFile::~SocketFile() {
  struct stat file = {};
  if (inode_ == 0 || stat(path_.c_str(), &file) != 0) return;
  if (file.st_dev == device_ && file.st_ino == inode_) unlink(path_.c_str());
}

}  // namespace planish
