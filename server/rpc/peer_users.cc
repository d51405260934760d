#include "server/rpc/peer_users.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"

namespace planish {
namespace {

constexpr char kDescriptor[] = "fd:";

// Most descriptor numbers that are tried for one connection. Even with many users, a few tries are enough.
constexpr int kMostTries = 4096;

int QuarterOfDescriptors() {
  rlimit limit = {};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 256;
  return static_cast<int>(std::clamp<rlim_t>(limit.rlim_cur / 4, 1, std::numeric_limits<int>::max()));
}

void CloseKeepingErrno(int fd) {
  const int error = errno;
  close(fd);
  errno = error;
}

}  // namespace

PeerUsers::PeerUsers(int most_per_user) : most_per_user_(most_per_user > 0 ? most_per_user : QuarterOfDescriptors()) {}

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
  int& count = counts_[uid];
  std::vector<int> taken;  // held until the end, so that the search goes on to other numbers
  int mine = fd;
  while (mine >= 0) {
    const auto owner = users_.find(mine);
    if (owner == users_.end() ? count < most_per_user_ : owner->second == uid) break;
    taken.push_back(mine);
    if (taken.size() < kMostTries) {
      mine = fcntl(mine, F_DUPFD_CLOEXEC, mine + 1);
    } else {
      mine = -1;
      errno = EMFILE;
    }
  }
  for (const int other : taken) CloseKeepingErrno(other);
  if (mine >= 0 && users_.emplace(mine, uid).second) ++count;
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
