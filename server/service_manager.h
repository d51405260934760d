// Tells systemd how the service does: the protocol of sd_notify(3), datagrams to the socket that NOTIFY_SOCKET names.
#pragma once

#include <string>

namespace planish {

// Without NOTIFY_SOCKET nothing is sent. What cannot be delivered is dropped: it must not hold up the service.
// Thread-safe after construction.
class ServiceManager {
 public:
  // Takes NOTIFY_SOCKET out of the environment, so that no child takes it for its own: make it before any thread.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  bool present() const { return !path_.empty(); }

  // `status`: a line for "systemctl status".
  void Ready(const std::string& status) const;
  // A reload begins; Ready() says that it is over, well or not.
  void Reloading() const;
  void Stopping(const std::string& status) const;
  void Status(const std::string& status) const;

 private:
  void Send(const std::string& text) const;

  std::string path_;  // a name that begins with '@' is an abstract one; empty: nobody listens
  int socket_ = -1;
};

}  // namespace planish
