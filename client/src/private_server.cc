#include "planish/private_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "client/src/find_planishd.h"
#include "client/src/process.h"
#include "core/base/program_path.h"
#include "planish/error.h"

namespace planish {
inline namespace abi0 {
namespace {

namespace fs = std::filesystem;

// The server drains without grace when we let go; a planishd that hangs is not waited for much longer than that.
constexpr double kStopSeconds = 5;
constexpr int kSupervisorFd = 3;

Error Failed(const std::string& message) {
  return Error(ErrorCode::kUnavailable, "PRIVATE_SERVER_FAILED", message);
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

struct PrivateServer::State {
  std::string executable;
  std::string directory;
  std::string target;
  OwnedFd supervisor;  // end of file here tells planishd that we are gone
  OwnedFd log;
  pid_t pid = -1;

  ~State() {
    supervisor.Reset();
    if (pid > 0 && !ReapWithin(pid, kStopSeconds)) {
      kill(pid, SIGKILL);
      ReapWithin(pid, kStopSeconds);
    }
    std::error_code ignored;
    if (!directory.empty()) fs::remove_all(directory, ignored);
  }

  std::string Log() const { return log.get() < 0 ? std::string() : ReadAll(log.get()); }

  std::string LogSuffix() const {
    std::string text = Log();
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text.empty() ? "" : "\n" + text;
  }

  void Start(const PrivateServerOptions& options) {
    directory = NewPrivateDirectory();
    target = "unix:" + directory + "/socket";
    log = OwnedFd(memfd_create("planishd-stderr", MFD_CLOEXEC));
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
    try {
      pid = Spawn(arguments, log.get(), theirs.get(), kSupervisorFd);
    } catch (const std::system_error& error) {
      throw Failed("cannot start " + executable + ": " + error.code().message());
    }
    theirs.Reset();
    WaitUntilReady(options.start_timeout_seconds);
  }

  void WaitUntilReady(double seconds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
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
        const bool ended = ReapWithin(pid, 1, &wait_status);
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

PrivateServer::PrivateServer(const PrivateServerOptions& options) : state_(std::make_unique<State>()) {
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

PrivateServer::~PrivateServer() = default;
PrivateServer::PrivateServer(PrivateServer&&) noexcept = default;
PrivateServer& PrivateServer::operator=(PrivateServer&&) noexcept = default;

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
