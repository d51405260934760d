// Finds the user of this machine at the other end of a Unix socket.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace planish {

// gRPC does not tell which user connected to a Unix socket. But if a connection is handed to gRPC, its name has the
// number of its descriptor ("fd:12"), and this table maps these numbers to users. A call may be looked up after its
// connection was closed and the number was reused, so a number that once belonged to one user is never used for another
// user. Thread-safe.
class PeerUsers {
 public:
  // No user gets more than `most_per_user` numbers, since a number stays with its user for good and one user could take
  // them all. 0: a quarter of the descriptors that the process may have.
  explicit PeerUsers(int most_per_user = 0);

  // Asks the kernel which user is at the other end of `fd`, and takes ownership of the descriptor. Returns the
  // descriptor to use instead, often `fd` itself; -1, with errno, if the kernel does not tell or the user has no
  // numbers left. Then `fd` is closed.
  int Add(int fd);

  // Add() for a descriptor of the user `uid`, whatever the kernel says; for tests.
  int AddAs(int fd, std::uint32_t uid);

  // The uid for a grpc::ServerContext::peer(); empty if that is not a Unix socket.
  std::optional<std::uint32_t> Find(const std::string& peer) const;

 private:
  mutable std::mutex mutex_;
  const int most_per_user_;
  std::map<int, std::uint32_t> users_;   // by descriptor, never erased; guarded by mutex_
  std::map<std::uint32_t, int> counts_;  // entries of users_, by user; guarded by mutex_
};

}  // namespace planish
