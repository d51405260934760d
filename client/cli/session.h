// Handles Ctrl-C, and chooses or starts the server of a command.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "client/cli/arguments.h"
#include "core/base/descriptor.h"
#include "core/base/execution.h"
#include "planish/client.h"

namespace planish::cli {

// ---- Ctrl-C, SIGTERM and SIGHUP: the first asks to cancel, the second leaves at once

// A process has one such object, made in main() before any other thread, because threads inherit its signal mask. Its
// thread reads signals from a descriptor, so the callbacks are not restricted like signal handlers.
class Interrupts {
 public:
  Interrupts();
  ~Interrupts();

  // The first signal calls `cancel` on the thread of this class; `cancel` must return soon. If no `cancel` is set, the
  // first signal ends the process at once.
  void SetCancel(std::function<void()> cancel);
  // Sets a function that is called before the process ends at once, because no destructors are called then.
  void SetLastWords(std::function<void()> last_words);

  bool interrupted() const { return interrupted_; }
  // Ends the process if the first signal has come. For work that must not be interrupted: call SetCancel([] {}) before
  // it, and this after it.
  void LeaveIfInterrupted();

 private:
  void Watch();
  [[noreturn]] void LeaveAtOnce();

  Descriptor signals_;
  Descriptor stop_;
  std::mutex mutex_;  // guards cancel_ and last_words_
  std::function<void()> cancel_;
  std::function<void()> last_words_;
  std::atomic<bool> interrupted_ = false;
  std::thread watcher_;
};

// ---- Work in this process

// Calls work(execution) with an execution on all cores that the first signal cancels. Returns whether it was cancelled.
bool IsInterruptedIn(Interrupts& interrupts, const std::function<void(const Execution&)>& work);

// ---- The server of --server, or a private server

struct ServerNeeds {
  // For a private server: concurrent jobs, and threads per job (0: cores divided by `workers`).
  int workers = 1;
  int threads = 0;
  ClientOptions client;
};

class ServerChoice {
 public:
  // Without an address, starts a private server. Throws planish::Error if that fails, and the errors of Client::Client.
  ServerChoice(const ServerArguments& server, Interrupts& interrupts, const ServerNeeds& needs = {});
  ~ServerChoice();

  Client& client() { return *client_; }
  // Text for --verbose: "Server farm:7741: planishd 0.1.0, 4 workers, 8 threads a job". Asks the server.
  std::string Description();
  // How long a private server took to start; 0 if --server names the server.
  double start_seconds() const { return start_seconds_; }
  // Null if --server names the server.
  const PrivateServer* private_server() const { return private_server_ ? &*private_server_ : nullptr; }

 private:
  const std::string address_;
  double start_seconds_ = 0;
  Interrupts& interrupts_;
  std::optional<PrivateServer> private_server_;
  std::optional<Client> client_;
};

}  // namespace planish::cli
