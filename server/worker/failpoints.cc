#include "server/worker/failpoints.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <memory>
#include <new>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {
namespace {

constexpr std::string_view kPoints[] = {"start", "decode", "solve", "encode", "result", "idle"};
constexpr std::string_view kActions[] = {"abort", "segv",       "exit",    "hang", "spin",
                                         "oom",   "oom-thread", "garbage", "mute", "probe"};
constexpr int kExitCode = 42;

[[noreturn]] void WriteNowhere() {
  volatile int* volatile nowhere = nullptr;
  *nowhere = 1;
  std::abort();
}

[[noreturn]] void Sleep() {
  while (true) pause();
}

[[noreturn]] void Spin() {
  std::atomic<std::uint64_t> count = 0;
  while (true) count.fetch_add(1, std::memory_order_relaxed);
}

// Allocates memory without writing to it, so that without a limit addresses run out before memory does.
void ExhaustMemory() {
  constexpr std::size_t kBlock = std::size_t{16} << 20;
  std::vector<std::unique_ptr<char[]>> blocks;
  while (true) blocks.emplace_back(new char[kBlock]);
}

void ExhaustMemoryElsewhere() {
  std::thread([]() noexcept { ExhaustMemory(); }).join();
}

std::string Outcome(long result) {
  if (result >= 0) return "allowed";
  const char* const name = strerrorname_np(errno);
  return name == nullptr ? std::to_string(errno) : name;
}

std::string TryFork() {
  const pid_t pid = fork();
  if (pid == 0) _exit(0);
  const std::string outcome = Outcome(pid);
  if (pid > 0) waitpid(pid, nullptr, 0);
  return outcome;
}

std::string TryExecutableMemory() {
  void* const page = mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  const std::string outcome = Outcome(page == MAP_FAILED ? -1 : 0);
  if (page != MAP_FAILED) munmap(page, 4096);
  return outcome;
}

std::string TryExec() {
  char name[] = "/bin/true";
  char* const argv[] = {name, nullptr};
  // Runs in its own process, so that a worker without a sandbox survives the probe.
  const pid_t pid = fork();
  if (pid == 0) _exit(execve(name, argv, nullptr) < 0 && errno == EPERM ? 1 : 0);
  if (pid < 0) return Outcome(execve(name, argv, nullptr));
  int status = 0;
  waitpid(pid, &status, 0);
  return status == 0 ? "allowed" : "EPERM";
}

std::string SoftLimit(__rlimit_resource resource) {
  rlimit limit = {};
  getrlimit(resource, &limit);
  return std::to_string(limit.rlim_cur);
}

// Counts environment variables that the server should not have passed on.
int CountForeignVariables() {
  int count = 0;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    count += text.starts_with("PLANISH") || text.starts_with("PATH=") || text.starts_with("HOME=") ? 1 : 0;
  }
  return count;
}

std::string Flag(int value) {
  return value < 0 ? Outcome(value) : std::to_string(value);
}

}  // namespace

absl::StatusOr<Failpoint> Failpoint::Parse(std::string_view text) {
  if (text.empty()) return Failpoint();
  const std::size_t equals = text.find('=');
  const std::string_view point = text.substr(0, equals);
  const std::string_view action = equals == text.npos ? "" : text.substr(equals + 1);
  if (std::count(std::begin(kPoints), std::end(kPoints), point) == 0 ||
      std::count(std::begin(kActions), std::end(kActions), action) == 0) {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                     "there is no failpoint " + std::string(text), {{"field", "failpoint"}});
  }
  return Failpoint{std::string(point), std::string(action)};
}

absl::Status ReachPoint(const Failpoint& failpoint, std::string_view point, const FailpointHooks& hooks) {
  if (failpoint.point != point) return absl::OkStatus();
  const std::string& action = failpoint.action;
  if (action == "abort") std::abort();
  if (action == "segv") WriteNowhere();
  if (action == "exit") _exit(kExitCode);
  if (action == "hang") Sleep();
  if (action == "spin") Spin();
  if (action == "oom") ExhaustMemory();
  if (action == "oom-thread") ExhaustMemoryElsewhere();
  if (action == "garbage" && hooks.send_garbage) hooks.send_garbage();
  if (action == "mute" && hooks.close_link) hooks.close_link();
  if (action == "probe") return Probe();
  return absl::OkStatus();
}

absl::Status Probe() {
  return MakeError(absl::StatusCode::kInternal, "PROBE", "what a worker may do",
                   {{"open", Outcome(open("/etc/passwd", O_RDONLY | O_CLOEXEC))},
                    {"create", Outcome(open("/tmp/planish-probe", O_RDWR | O_CREAT | O_CLOEXEC, 0600))},
                    {"socket", Outcome(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0))},
                    {"unix_socket", Outcome(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0))},
                    {"execve", TryExec()},
                    {"fcntl", Outcome(fcntl(STDERR_FILENO, F_SETFL, O_NONBLOCK | O_ASYNC))},
                    {"environment", std::to_string(CountForeignVariables())},
                    {"fork", TryFork()},
                    {"kill", Outcome(kill(getppid(), 0))},
                    {"ptrace", Outcome(ptrace(PTRACE_PEEKUSER, -1, nullptr, nullptr))},
                    {"executable_memory", TryExecutableMemory()},
                    {"thread",
                     [] {
                       bool ran = false;
                       std::thread([&ran] { ran = true; }).join();
                       return ran ? "allowed" : "lost";
                     }()},
                    {"core_limit", SoftLimit(RLIMIT_CORE)},
                    {"descriptor_limit", SoftLimit(RLIMIT_NOFILE)},
                    {"no_new_privileges", Flag(prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0))}});
}

}  // namespace planish
