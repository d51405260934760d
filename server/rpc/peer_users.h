// Which user of this machine is at the other end of a Unix socket.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace planish {

// gRPC does not tell who connected to a Unix socket, but it names a connection by its descriptor ("fd:12") if it is
// given one. This table says which user such a connection belongs to. A call may ask after its connection has ended and
// the number was given away again: so a number that once was one user's is never used for another's. Thread-safe.
class PeerUsers {
 public:
  // No user has more than `most_per_user` numbers, so that none can take them all, for good. 0: a quarter of what the
  // system allows the process.
  explicit PeerUsers(int most_per_user = 0);

  // Asks the kernel who is at the other end of `fd`, and takes the descriptor over. The one to use in its place, often
  // itself; -1, with errno, if the kernel does not say or this user's numbers run out; `fd` is closed then.
  int Add(int fd);

  // The same without the kernel, for tests.
  int AddAs(int fd, std::uint32_t uid);

  // The uid behind grpc::ServerContext::peer(); nothing if it is no Unix socket.
  std::optional<std::uint32_t> Find(const std::string& peer) const;

 private:
  mutable std::mutex mutex_;
  const int most_per_user_;
  std::map<int, std::uint32_t> users_;   // by descriptor, for good; guarded by mutex_
  std::map<std::uint32_t, int> counts_;  // of users_, by user; guarded by mutex_
};

}  // namespace planish
