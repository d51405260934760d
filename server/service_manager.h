// Reports the state of the service to systemd by the protocol of sd_notify(3): datagrams to the socket that
// NOTIFY_SOCKET names.
#pragma once

#include <string>

namespace planish {

// Sends nothing without NOTIFY_SOCKET. Messages that cannot be delivered are dropped, so that they never delay the
// service. Thread-safe after construction.
class ServiceManager {
 public:
  // Removes NOTIFY_SOCKET from the environment, so that no child process uses it. Construct it before any thread
  // starts.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  bool present() const { return !path_.empty(); }

  // `status`: a line for "systemctl status".
  void Ready(const std::string& status) const;
  // A reload begins. Call Ready() at its end, whether it succeeded or not.
  void Reloading() const;
  void Stopping(const std::string& status) const;
  void Status(const std::string& status) const;

 private:
  void Send(const std::string& text) const;

  std::string path_;  // a name that begins with '@' is abstract; empty: no service manager
  int socket_ = -1;
};

}  // namespace planish
