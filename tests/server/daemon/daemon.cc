#include "tests/server/daemon/daemon.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>
#include <utility>

namespace planish {

Daemon::Daemon(std::vector<std::string> flags, bool supervised) {
  std::array<int, 2> supervisor = {-1, -1};
  std::array<int, 2> output = {-1, -1};
  if (supervised) {
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, supervisor.data()) != 0)
      throw std::runtime_error("socketpair");
    fcntl(supervisor[1], F_SETFD, 0);
    flags.push_back("--supervisor-fd=" + std::to_string(supervisor[1]));
  }
  if (pipe2(output.data(), O_CLOEXEC) != 0) throw std::runtime_error("pipe2");
  flags.insert(flags.begin(), PLANISHD);
  std::vector<char*> arguments;
  for (std::string& flag : flags) arguments.push_back(flag.data());
  arguments.push_back(nullptr);

  pid_ = fork();
  if (pid_ == 0) {
    dup2(output[1], STDOUT_FILENO);
    dup2(output[1], STDERR_FILENO);
    execv(PLANISHD, arguments.data());
    _exit(127);
  }
  close(output[1]);
  output_ = output[0];
  if (supervised) {
    close(supervisor[1]);
    supervisor_ = supervisor[0];
  }
}

Daemon::~Daemon() {
  CloseSupervisor();
  if (pid_ > 0) {
    Signal(SIGKILL);
    Wait();
  }
  close(output_);
}

bool Daemon::WaitReady() {
  std::array<char, 16> buffer;
  return read(supervisor_, buffer.data(), buffer.size()) == 6 && std::string(buffer.data(), 6) == "ready\n";
}

void Daemon::Signal(int signal) const {
  kill(pid_, signal);
}

void Daemon::CloseSupervisor() {
  if (supervisor_ >= 0) close(std::exchange(supervisor_, -1));
}

int Daemon::Wait() {
  Output();
  int status = 0;
  waitpid(std::exchange(pid_, -1), &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

std::string Daemon::ReadUntil(const std::string& text) {
  std::array<char, 4096> buffer;
  ssize_t length = 0;
  while (text_.find(text) == std::string::npos && (length = read(output_, buffer.data(), buffer.size())) > 0) {
    text_.append(buffer.data(), static_cast<std::size_t>(length));
  }
  return text_;
}

std::string Daemon::Output() {
  std::array<char, 4096> buffer;
  for (ssize_t length; (length = read(output_, buffer.data(), buffer.size())) > 0;) {
    text_.append(buffer.data(), static_cast<std::size_t>(length));
  }
  return text_;
}

}  // namespace planish
