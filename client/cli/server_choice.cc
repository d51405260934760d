#include "client/cli/server_choice.h"

#include <filesystem>

namespace planish::cli {

ServerChoice::ServerChoice(const std::string& address, const ServerFlags& flags, Interrupts& interrupts,
                           const ServerNeeds& needs)
    : interrupts_(interrupts) {
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
  if (address.empty()) options.reattach_timeout = options.retry_timeout = Seconds(1);
  client_.emplace(address.empty() ? private_server_->target() : address, options);
}

ServerChoice::~ServerChoice() {
  client_.reset();
  private_server_.reset();  // may take a moment
  interrupts_.SetLastWords({});
}

}  // namespace planish::cli
