// The service manager's end of NOTIFY_SOCKET.
#pragma once

#include <optional>
#include <string>

namespace planish {

class NotifySocket {
 public:
  // Puts its address, that of a socket file `path`, into the environment: processes that start from now on notify it.
  explicit NotifySocket(const std::string& path);
  ~NotifySocket();
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  // The next datagram; nothing if none comes within a minute.
  std::optional<std::string> Next();

  // Waits for one with this line.
  bool WaitFor(const std::string& line);

 private:
  int socket_;
};

}  // namespace planish
