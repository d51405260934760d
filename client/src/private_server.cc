#include "planish/private_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <thread>

#include "absl/strings/ascii.h"
#include "absl/strings/str_split.h"
#include "client/src/errors.h"
#include "client/src/process.h"
#include "core/base/program_path.h"

extern char** environ;

namespace planish {
namespace fs = std::filesystem;
namespace {

// They configure the planishd of this machine, if there is one, and not the private ones that we start.
constexpr std::string_view kServiceVariables = "PLANISHD_";
// The server drains without grace when we let go; a planishd that hangs is not waited for much longer than that.
constexpr std::chrono::seconds kStopLimit{5};
constexpr int kSupervisorFd = 3;

Error Failed(const std::string& message) {
  return Error(ErrorCode::kUnavailable, "PRIVATE_SERVER_FAILED", message);
}

// Starts `arguments[0]`, a path, in a process group of its own (so that Ctrl-C reaches only us), with an empty signal
// mask, default signal actions, no input, no output, stderr to the file `stderr_path`, `supervisor` as descriptor
// kSupervisorFd, and the environment without what is for a service (PLANISHD_QUEUE, ...).
pid_t Spawn(const std::vector<std::string>& arguments, const std::string& stderr_path, int supervisor) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, stderr_path.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  // Also clears close-on-exec where both numbers agree.
  posix_spawn_file_actions_adddup2(&actions, supervisor, kSupervisorFd);

  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);

  std::vector<char*> variables;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (!std::string_view(*entry).starts_with(kServiceVariables)) variables.push_back(*entry);
  }
  variables.push_back(nullptr);

  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, argv[0], &actions, &attributes, argv.data(), variables.data());
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) throw Failed("cannot start " + arguments[0] + ": " + std::strerror(error));
  return pid;
}

// Waits for the end of a child and reaps it; false if it still runs then.
bool ReapWithin(pid_t pid, std::chrono::milliseconds limit, int* wait_status = nullptr) {
  const auto end = std::chrono::steady_clock::now() + limit;
  int status = 0;
  while (waitpid(pid, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (wait_status != nullptr) *wait_status = status;
  return true;
}

// A directory only this user can enter, at a path short enough for a socket's name (108 bytes).
std::string NewPrivateDirectory() {
  const char* const bases[] = {std::getenv("XDG_RUNTIME_DIR"), std::getenv("TMPDIR"), "/tmp"};
  for (const char* base : bases) {
    if (base == nullptr || *base != '/' || std::strlen(base) > 60) continue;
    std::string path = std::string(base) + "/planish-XXXXXX";
    if (mkdtemp(path.data()) != nullptr) return path;
  }
  throw Failed("cannot make a directory for the server's socket in $XDG_RUNTIME_DIR, $TMPDIR or /tmp: " +
               std::string(std::strerror(errno)));
}

std::string HowItEnded(int wait_status) {
  if (WIFSIGNALED(wait_status)) return "was killed by signal " + std::to_string(WTERMSIG(wait_status));
  return "exited with code " + std::to_string(WEXITSTATUS(wait_status));
}

}  // namespace

void OwnedFd::Reset() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

bool IsExecutable(const std::string& path) {
  struct stat info;
  return stat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode) && access(path.c_str(), X_OK) == 0;
}

std::string FindPlanishd(const std::string& directory) {
  if (!directory.empty()) {
    for (const fs::path& candidate : {fs::path(directory) / "planishd", fs::path(directory) / "../bin/planishd"}) {
      if (IsExecutable(candidate)) return candidate.lexically_normal();
    }
  }
  const char* named = std::getenv("PLANISHD");
  if (named != nullptr && *named != '\0') return IsExecutable(named) ? named : "";
  const char* path = std::getenv("PATH");
  const std::vector<std::string> entries = absl::StrSplit(path == nullptr ? "" : path, ':', absl::SkipEmpty());
  for (const std::string& entry : entries) {
    const fs::path candidate = fs::path(entry) / "planishd";
    if (IsExecutable(candidate)) return candidate;
  }
  return "";
}

inline namespace abi0 {

struct PrivateServer::State {
  std::string executable;
  std::string directory;
  std::string target;
  OwnedFd supervisor;  // end of file here tells planishd that we are gone
  pid_t pid = -1;

  ~State() {
    supervisor.Reset();
    if (pid > 0 && !ReapWithin(pid, kStopLimit)) {
      kill(pid, SIGKILL);
      ReapWithin(pid, kStopLimit);
    }
    std::error_code ignored;
    if (!directory.empty()) fs::remove_all(directory, ignored);
  }

  std::string LogPath() const { return directory + "/log"; }

  std::string Log() const {
    std::ifstream in(LogPath(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::string LogSuffix() const {
    std::string text = Log();
    absl::StripTrailingAsciiWhitespace(&text);
    return text.empty() ? "" : "\n" + text;
  }

  void Start(const PrivateServerOptions& options) {
    directory = NewPrivateDirectory();
    target = "unix:" + directory + "/socket";
    int sockets[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0) {
      throw Failed(std::string("socketpair: ") + std::strerror(errno));
    }
    supervisor = OwnedFd(sockets[0]);
    OwnedFd theirs(sockets[1]);
    std::vector<std::string> arguments = {executable, "--listen=" + target,
                                          "--supervisor-fd=" + std::to_string(kSupervisorFd),
                                          "--workers=" + std::to_string(options.workers), "--log-level=warn"};
    if (options.threads > 0) arguments.push_back("--threads=" + std::to_string(options.threads));
    arguments.insert(arguments.end(), options.extra_arguments.begin(), options.extra_arguments.end());
    pid = Spawn(arguments, LogPath(), theirs.get());
    theirs.Reset();
    WaitUntilReady(options.start_timeout);
  }

  void WaitUntilReady(Seconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    std::string said;
    while (said.find('\n') == std::string::npos) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      pollfd wait = {supervisor.get(), POLLIN, 0};
      const int ready = left.count() <= 0 ? 0 : poll(&wait, 1, static_cast<int>(left.count()));
      if (ready < 0 && errno == EINTR) continue;
      if (ready <= 0) throw Failed(executable + " did not become ready in time" + LogSuffix());
      char buffer[64];
      const ssize_t count = read(supervisor.get(), buffer, sizeof buffer);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) {
        int wait_status = 0;
        const bool ended = ReapWithin(pid, std::chrono::seconds(1), &wait_status);
        if (ended) pid = -1;
        throw Failed(executable + " " + (ended ? HowItEnded(wait_status) : "let go of us") + " while it started" +
                     LogSuffix());
      }
      said.append(buffer, static_cast<std::size_t>(count));
    }
    if (said.rfind("ready\n", 0) != 0) throw Failed(executable + " said \"" + said + "\" instead of \"ready\"");
  }
};

std::string FindPrivateServer() {
  return FindPlanishd(fs::path(SelfPath()).parent_path());
}

PrivateServer::PrivateServer(const PrivateServerOptions& options) : state_(std::make_shared<State>()) {
  state_->executable = options.executable.empty() ? FindPrivateServer() : options.executable;
  if (state_->executable.empty()) {
    const char* named = std::getenv("PLANISHD");
    throw Failed(named != nullptr && *named != '\0'
                     ? std::string("cannot find planishd: $PLANISHD is ") + named + ", which is not a program"
                     : "cannot find planishd beside this program, in $PLANISHD or in PATH");
  }
  if (!IsExecutable(state_->executable)) throw Failed(state_->executable + " is not a program");
  state_->Start(options);
}

Result<PrivateServer> PrivateServer::Make(const PrivateServerOptions& options) {
  return Caught([&] { return PrivateServer(options); });
}

const std::string& PrivateServer::target() const {
  return state_->target;
}
const std::string& PrivateServer::executable() const {
  return state_->executable;
}
int PrivateServer::pid() const {
  return state_->pid;
}
const std::string& PrivateServer::directory() const {
  return state_->directory;
}
std::string PrivateServer::log() const {
  return state_->Log();
}

}  // namespace abi0
}  // namespace planish
