#include "client/cli/session.h"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <utility>

#include "client/cli/exit_codes.h"
#include "client/cli/text.h"
#include "core/base/timer.h"

namespace planish::cli {

Interrupts::Interrupts() {
  sigset_t watched;
  sigemptyset(&watched);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    // A signal ignored by the parent (nohup, a background job) stays ignored.
    struct sigaction action = {};
    sigaction(signal, nullptr, &action);
    if (action.sa_handler != SIG_IGN) sigaddset(&watched, signal);
  }
  pthread_sigmask(SIG_BLOCK, &watched, nullptr);
  // Writing to a closed pipe must return an error, not end the process.
  signal(SIGPIPE, SIG_IGN);
  signals_ = Descriptor(signalfd(-1, &watched, SFD_CLOEXEC));
  stop_ = Descriptor(eventfd(0, EFD_CLOEXEC));
  watcher_ = std::thread([this] { Watch(); });
}

Interrupts::~Interrupts() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(stop_.get(), &one, sizeof one);
  watcher_.join();
}

void Interrupts::SetCancel(std::function<void()> cancel) {
  const std::lock_guard lock(mutex_);
  cancel_ = std::move(cancel);
}

void Interrupts::SetLastWords(std::function<void()> last_words) {
  const std::lock_guard lock(mutex_);
  last_words_ = std::move(last_words);
}

void Interrupts::Watch() {
  for (;;) {
    pollfd wait[] = {{signals_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}};
    if (poll(wait, 2, -1) < 0 && errno == EINTR) continue;
    if ((wait[1].revents & POLLIN) != 0) return;
    signalfd_siginfo info;
    if (read(signals_.get(), &info, sizeof info) != sizeof info) continue;
    const std::lock_guard lock(mutex_);
    if (interrupted_.exchange(true) || !cancel_) LeaveAtOnce();
    cancel_();
  }
}

void Interrupts::LeaveIfInterrupted() {
  const std::lock_guard lock(mutex_);
  if (interrupted_) LeaveAtOnce();
}

void Interrupts::LeaveAtOnce() {
  if (last_words_) last_words_();
  _exit(kInterrupted);
}

bool IsInterruptedIn(Interrupts& interrupts, const std::function<void(const Execution&)>& work) {
  const auto interrupter = std::make_shared<Interrupter>();
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  execution.cancel = interrupter.get();
  interrupts.SetCancel([interrupter] { interrupter->Interrupt(); });
  work(execution);
  interrupts.SetCancel({});
  return interrupter->IsInterrupted();
}

ServerChoice::ServerChoice(const ServerArguments& server, Interrupts& interrupts, const ServerNeeds& needs)
    : address_(server.address), interrupts_(interrupts) {
  if (address_.empty()) {
    PrivateServerOptions options;
    options.workers = needs.workers;
    options.threads = needs.threads;
    interrupts.SetCancel([] {});  // no exit before the last words below are set
    const Timer timer;
    private_server_.emplace(options);
    start_seconds_ = timer.Seconds();
    // An exit at once skips destructors. The server then ends by itself, but its directory must be removed.
    interrupts.SetLastWords([directory = private_server_->directory()] {
      std::error_code ignored;
      std::filesystem::remove_all(directory, ignored);
    });
    interrupts.SetCancel({});
    interrupts.LeaveIfInterrupted();
  }
  ClientOptions options = private_server_ ? needs.client : WithServer(needs.client, server);
  // A private server that died does not come back, so retries end soon.
  if (private_server_) options.reattach_timeout = options.retry_timeout = Seconds(1);
  client_.emplace(private_server_ ? private_server_->target() : address_, options);
}

std::string ServerChoice::Description() {
  const Capabilities capabilities = client_->GetCapabilities();
  return (private_server_ ? "Private server " + private_server_->executable() : "Server " + address_) + ": planishd " +
         capabilities.version + ", " + Counted(capabilities.workers, "worker", "workers") + ", " +
         Counted(capabilities.threads, "thread", "threads") + " a job";
}

ServerChoice::~ServerChoice() {
  client_.reset();
  private_server_.reset();  // waits for the server to end; the last words are still set meanwhile
  interrupts_.SetLastWords({});
}

}  // namespace planish::cli
