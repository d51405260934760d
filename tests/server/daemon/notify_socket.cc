#include "tests/server/daemon/notify_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <stdexcept>

namespace planish {

NotifySocket::NotifySocket(const std::string& path) : socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    throw std::runtime_error("bind");
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
}

NotifySocket::~NotifySocket() {
  unsetenv("NOTIFY_SOCKET");
  close(socket_);
}

std::optional<std::string> NotifySocket::Next() {
  constexpr int kPatienceMs = 60'000;
  pollfd wait = {socket_, POLLIN, 0};
  if (poll(&wait, 1, kPatienceMs) <= 0) return std::nullopt;
  std::array<char, 4096> buffer;
  const ssize_t length = recv(socket_, buffer.data(), buffer.size(), 0);
  return std::string(buffer.data(), length > 0 ? static_cast<std::size_t>(length) : 0);
}

bool NotifySocket::WaitFor(const std::string& line) {
  while (const std::optional<std::string> text = Next()) {
    if (("\n" + *text + "\n").find("\n" + line + "\n") != std::string::npos) return true;
  }
  return false;
}

}  // namespace planish
