#include "tests/testing/process.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "core/base/sanitizers.h"

extern char** environ;

namespace planish {
namespace {

std::vector<std::string> Environment(const ProcessOptions& options) {
  std::map<std::string, std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    if (!options.without.empty() && text.rfind(options.without, 0) == 0) continue;
    const std::size_t equals = text.find('=');
    variables[text.substr(0, equals)] = text.substr(equals + 1);
  }
  for (const auto& [name, value] : options.environment) variables[name] = value;
  std::vector<std::string> definitions;
  for (const auto& [name, value] : variables) definitions.push_back(name + "=" + value);
  return definitions;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::string ReadMemory(int fd) {
  std::string text;
  char buffer[1 << 14];
  for (ssize_t size; (size = pread(fd, buffer, sizeof buffer, static_cast<off_t>(text.size()))) > 0;) {
    text.append(buffer, static_cast<std::size_t>(size));
  }
  return text;
}

}  // namespace

Process::Process(std::vector<std::string> arguments, const ProcessOptions& options)
    : out_(memfd_create("out", MFD_CLOEXEC)), err_(memfd_create("err", MFD_CLOEXEC)), start_(Now()) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, options.merged ? err_ : out_, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err_, STDERR_FILENO);
  // Onto itself: it is not closed then.
  if (options.inherited_fd >= 0) {
    posix_spawn_file_actions_adddup2(&actions, options.inherited_fd, options.inherited_fd);
  }
  // Whoever started the tests in the background has made SIGINT ignored; the program must not inherit that.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t all;
  sigfillset(&all);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  std::vector<std::string> environment = Environment(options);
  const std::string program = arguments.at(0);
  const int error = posix_spawn(&pid_, program.c_str(), &actions, &attributes, Pointers(arguments).data(),
                                Pointers(environment).data());
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) {
    close(out_);
    close(err_);
    throw std::runtime_error("cannot start " + program);
  }
}

Process::~Process() {
  Signal(SIGKILL);
  Reap(0);
  close(out_);
  close(err_);
}

void Process::Signal(int signal) const {
  if (!ended_) kill(pid_, signal);
}

void Process::Reap(int options) {
  int status = 0;
  if (ended_ || waitpid(pid_, &status, options) != pid_) return;
  ended_ = true;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

bool Process::IsRunning() {
  Reap(WNOHANG);
  return !ended_;
}

std::string Process::Out() const {
  return ReadMemory(out_);
}

std::string Process::Err() const {
  return ReadMemory(err_);
}

bool Process::WaitForErr(const std::string& text, double seconds) {
  bool running = true;
  return WaitUntil(
             [&] {
               running = IsRunning();
               return Err().find(text) != std::string::npos || !running;
             },
             seconds) &&
         (running || Err().find(text) != std::string::npos);
}

Outcome Process::Wait() {
  Reap(0);
  return {exit_code_, Out(), Err(), Now() - start_};
}

Outcome RunShell(const std::string& command) {
  return Process({"/bin/sh", "-c", command}).Wait();
}

std::vector<pid_t> ChildrenOf(pid_t pid) {
  std::vector<pid_t> children;
  std::error_code error;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task", error)) {
    std::ifstream pids(thread.path() / "children");
    for (pid_t child = 0; pids >> child;) children.push_back(child);
  }
  return children;
}

namespace {

// What follows the program's name in /proc/PID/stat, from field 3 on: numbers, but for the first. Empty if there is no
// such process.
std::istringstream StatOf(pid_t pid) {
  std::ostringstream stat;
  stat << std::ifstream("/proc/" + std::to_string(pid) + "/stat").rdbuf();
  const std::string text = stat.str();
  const std::size_t name_end = text.rfind(')');
  return std::istringstream(name_end == std::string::npos ? "" : text.substr(name_end + 1));
}

}  // namespace

char StateOf(pid_t pid) {
  char state = '?';
  StatOf(pid) >> state;
  return state;
}

double CpuSecondsOf(pid_t pid) {
  std::istringstream stat = StatOf(pid);
  std::string field;
  for (int i = 3; i < 14; ++i) stat >> field;
  double user = 0, system = 0;
  stat >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

int FreePort() {
  // Below the range from which the kernel takes ports for connections and for servers that leave the choice to it:
  // there nobody takes by accident what was free a moment ago.
  static std::minstd_rand random(std::random_device{}());
  std::uniform_int_distribution<int> ports(10'000, 30'000);
  while (true) {
    const int port = ports(random);
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) throw std::runtime_error("socket");
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    const bool is_free = bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    close(fd);
    if (is_free) return port;
  }
}

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

bool WaitUntil(const std::function<bool()>& condition, double seconds) {
  for (const double end = Now() + (kSanitized ? 5 : 1) * seconds;;) {
    if (condition()) return true;
    if (Now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

}  // namespace planish
