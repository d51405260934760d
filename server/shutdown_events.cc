#include "server/shutdown_events.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <utility>

#include "absl/time/clock.h"

namespace planish {
namespace {

// Threads that libraries start before main() do not block the signals. Such a thread passes a signal on to the thread
// that waits for it.
volatile sig_atomic_t waiting_thread = 0;

void HandOver(int signal) {
  syscall(SYS_tgkill, getpid(), static_cast<pid_t>(waiting_thread), signal);
}

}  // namespace

ShutdownEvents::ShutdownEvents(int supervisor_fd) : supervisor_fd_(supervisor_fd) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGHUP);
  if (supervisor_fd_ < 0) {
    sigaddset(&signals, SIGINT);
  } else {
    std::signal(SIGINT, SIG_IGN);
    fcntl(supervisor_fd_, F_SETFD, FD_CLOEXEC);
    fcntl(supervisor_fd_, F_SETFL, fcntl(supervisor_fd_, F_GETFL) | O_NONBLOCK);
  }
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiting_thread = gettid();
  std::signal(SIGTERM, HandOver);
  std::signal(SIGHUP, HandOver);
  if (supervisor_fd_ < 0) std::signal(SIGINT, HandOver);
  std::signal(SIGPIPE, SIG_IGN);
  signal_fd_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  idle_fd_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  failed_fd_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
}

ShutdownEvents::~ShutdownEvents() {
  for (const int fd : {supervisor_fd_, signal_fd_, idle_fd_, failed_fd_}) {
    if (fd >= 0) close(fd);
  }
}

void ShutdownEvents::TellReady() {
  constexpr char kReady[] = "ready\n";
  // Errors are ignored: if the supervisor is gone, Wait() reports that.
  if (supervisor_fd_ >= 0) [[maybe_unused]]
    const ssize_t written = write(supervisor_fd_, kReady, sizeof(kReady) - 1);
}

Wake ShutdownEvents::Wait(absl::Duration timeout) {
  const absl::Time end = absl::Now() + timeout;
  while (true) {
    std::array<pollfd, 4> fds = {
        {{signal_fd_, POLLIN, 0}, {idle_fd_, POLLIN, 0}, {supervisor_fd_, POLLIN, 0}, {failed_fd_, POLLIN, 0}}};
    constexpr absl::Duration kLongest = absl::Hours(1);  // poll() takes an int of milliseconds
    const absl::Duration left = std::min(std::max(end - absl::Now(), absl::ZeroDuration()), kLongest);
    const int ready = poll(fds.data(), fds.size(),
                           static_cast<int>(absl::ToInt64Milliseconds(absl::Ceil(left, absl::Milliseconds(1)))));
    if (ready == 0 && absl::Now() >= end) return Wake::kTimeout;
    if (ready <= 0) continue;
    signalfd_siginfo signal = {};
    if (read(signal_fd_, &signal, sizeof(signal)) == sizeof(signal)) {
      return signal.ssi_signo == SIGHUP ? Wake::kReload : Wake::kSignal;
    }
    std::uint64_t count = 0;
    if (read(idle_fd_, &count, sizeof(count)) == sizeof(count)) return Wake::kIdle;
    if (read(failed_fd_, &count, sizeof(count)) == sizeof(count)) return Wake::kFailed;
    if (fds[2].revents != 0 && SupervisorGone()) return Wake::kSupervisorGone;
  }
}

bool ShutdownEvents::SupervisorGone() {
  std::array<char, 64> ignored;
  const ssize_t length = read(supervisor_fd_, ignored.data(), ignored.size());
  if (length > 0 || (length < 0 && (errno == EAGAIN || errno == EINTR))) return false;
  close(std::exchange(supervisor_fd_, -1));
  return true;
}

void ShutdownEvents::NotifyFailed() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(failed_fd_, &one, sizeof(one));
}

void ShutdownEvents::NotifyIdle() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(idle_fd_, &one, sizeof(one));
}

}  // namespace planish
