#pragma once

#include <httplib.h>

#include <atomic>
#include <cstddef>
#include <string>

#include "absl/time/time.h"

namespace planish {

// A connection that ends at a given time whatever the other side does, and reads so many bytes at most. Reads and
// writes fail from then on.
class DeadlineStream : public httplib::Stream {
 public:
  // `socket` is not blocking and stays the caller's. `ending` cuts it off, within a fraction of a second.
  DeadlineStream(int socket, absl::Time deadline, std::size_t most_read, const std::atomic<bool>* ending)
      : socket_(socket), deadline_(deadline), left_to_read_(most_read), ending_(*ending) {}

  bool is_readable() const override;
  bool is_writable() const override;
  ssize_t read(char* data, std::size_t size) override;
  ssize_t write(const char* data, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  socket_t socket() const override { return socket_; }
  using httplib::Stream::write;

 private:
  // Whether the socket becomes ready for `events` in time.
  bool WaitFor(short events) const;
  // The next bytes, into buffer_: the parser asks for one at a time.
  bool Fill();

  const int socket_;
  const absl::Time deadline_;
  std::size_t left_to_read_;
  const std::atomic<bool>& ending_;
  std::string buffer_;
  std::size_t taken_ = 0;  // of buffer_
};

}  // namespace planish
