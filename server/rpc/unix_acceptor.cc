#include "server/rpc/unix_acceptor.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace planish {
namespace {

// Connections that may wait to be accepted: after a restart hundreds of clients come back at once. The kernel lowers
// the number to net.core.somaxconn.
constexpr int kBacklog = 4096;

// Pause after accept() failed for lack of descriptors or memory.
constexpr int kPauseMs = 50;

absl::Status Failed(int fd) {
  const absl::Status status = absl::UnavailableError(std::generic_category().message(errno));
  if (fd >= 0) close(fd);
  return status;
}

}  // namespace

absl::StatusOr<std::unique_ptr<UnixListener>> UnixListener::Open(const std::string& path, mode_t mode) {
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return Failed(fd);
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  if (bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) return Failed(fd);
  if (chmod(path.c_str(), mode) != 0 || listen(fd, kBacklog) != 0) return Failed(fd);
  return std::unique_ptr<UnixListener>(new UnixListener(fd));
}

UnixListener::~UnixListener() {
  close(fd_);
}

UnixAcceptor::UnixAcceptor(std::vector<std::unique_ptr<UnixListener>> listeners, std::function<void(int fd)> take)
    : listeners_(std::move(listeners)),
      take_(std::move(take)),
      stop_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      thread_([this] { Run(); }) {}

UnixAcceptor::~UnixAcceptor() {
  eventfd_write(stop_, 1);
  thread_.join();
  close(stop_);
}

void UnixAcceptor::Run() {
  std::vector<pollfd> waits = {{stop_, POLLIN, 0}};
  for (const auto& listener : listeners_) waits.push_back({listener->fd(), POLLIN, 0});
  while (true) {
    if (poll(waits.data(), waits.size(), -1) < 0) continue;  // interrupted by a signal
    if (waits[0].revents != 0) return;
    bool is_short = false;
    for (std::size_t i = 1; i < waits.size(); ++i) {
      if (waits[i].revents == 0) continue;
      const int fd = accept4(waits[i].fd, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (fd >= 0) {
        take_(fd);
      } else {
        is_short = is_short || errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
      }
    }
    if (is_short) poll(waits.data(), 1, kPauseMs);
  }
}

}  // namespace planish
