#include "client/cli/interrupts.h"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "client/cli/exit_codes.h"

namespace planish::cli {

Interrupts::Interrupts() {
  sigset_t watched;
  sigemptyset(&watched);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    // nohup and shells that start us in the background have said that this one is not for us.
    struct sigaction action = {};
    sigaction(signal, nullptr, &action);
    if (action.sa_handler != SIG_IGN) sigaddset(&watched, signal);
  }
  pthread_sigmask(SIG_BLOCK, &watched, nullptr);
  // Writing to a pipe whose reader left must be an error, not the end.
  signal(SIGPIPE, SIG_IGN);
  signals_ = OwnedFd(signalfd(-1, &watched, SFD_CLOEXEC));
  stop_ = OwnedFd(eventfd(0, EFD_CLOEXEC));
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

}  // namespace planish::cli
