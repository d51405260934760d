#include "client/cli/server_choice.h"

#include <filesystem>

#include "client/cli/numbers.h"

namespace planish::cli {

ServerChoice::ServerChoice(const std::string& address, const ServerFlags& flags, Interrupts& interrupts,
                           const ServerNeeds& needs)
    : address_(address), interrupts_(interrupts) {
  if (address.empty()) {
    PrivateServerOptions options;
    options.workers = needs.workers;
    options.threads = needs.threads;
    interrupts.SetCancel([] {});  // until there are last words
    private_server_.emplace(options);
    // Leaving at once skips destructors: the server ends by itself, but nobody else removes its socket.
    interrupts.SetLastWords([directory = private_server_->directory()] {
      std::error_code ignored;
      std::filesystem::remove_all(directory, ignored);
    });
    interrupts.SetCancel({});
    interrupts.LeaveIfInterrupted();
  }
  ClientOptions options = address.empty() ? needs.client : WithServerFlags(needs.client, flags);
  // A private server that is lost does not come back.
  if (address.empty()) options.reattach_seconds = options.retry_seconds = 1;
  client_.emplace(address.empty() ? private_server_->target() : address, options);
}

std::string ServerChoice::Description() {
  const Capabilities capabilities = client_->GetCapabilities();
  return (private_server_ ? "Private server " + private_server_->executable() : "Server " + address_) + ": planishd " +
         capabilities.version + ", " + Counted(capabilities.workers, "worker", "workers") + ", " +
         Counted(capabilities.threads, "thread", "threads") + " a job";
}

ServerChoice::~ServerChoice() {
  client_.reset();
  private_server_.reset();  // may take a moment
  interrupts_.SetLastWords({});
}

}  // namespace planish::cli
