#include "server/rpc/peer_users.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"

namespace planish {
namespace {

constexpr char kDescriptor[] = "fd:";

void CloseKeepingErrno(int fd) {
  const int error = errno;
  close(fd);
  errno = error;
}

}  // namespace

int PeerUsers::Add(int fd) {
  ucred peer = {};
  socklen_t size = sizeof(peer);
  if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
    CloseKeepingErrno(fd);
    return -1;
  }
  return AddAs(fd, peer.uid);
}

int PeerUsers::AddAs(int fd, std::uint32_t uid) {
  const std::lock_guard lock(mutex_);
  std::vector<int> taken;  // held until the end, so that the search goes on to other numbers
  int mine = fd;
  while (true) {
    const auto owner = users_.find(mine);
    if (owner == users_.end() || owner->second == uid) break;
    taken.push_back(mine);
    mine = fcntl(mine, F_DUPFD_CLOEXEC, mine + 1);
    if (mine < 0) break;
  }
  for (const int other : taken) CloseKeepingErrno(other);
  if (mine >= 0) users_[mine] = uid;
  return mine;
}

std::optional<std::uint32_t> PeerUsers::Find(const std::string& peer) const {
  int fd = -1;
  if (!absl::StartsWith(peer, kDescriptor) || !absl::SimpleAtoi(peer.substr(sizeof(kDescriptor) - 1), &fd)) {
    return std::nullopt;
  }
  const std::lock_guard lock(mutex_);
  const auto found = users_.find(fd);
  return found == users_.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace planish
