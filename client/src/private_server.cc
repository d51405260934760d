#include "planish/private_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
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
#include "core/base/descriptor.h"
#include "core/base/program_path.h"
#include "core/base/spawn.h"

extern char** environ;

namespace planish {
namespace fs = std::filesystem;
namespace {

// Variables that configure this machine's planishd. They are not passed to private servers.
constexpr std::string_view kServiceVariables = "PLANISHD_";
// When the server is told to stop, it ends its jobs at once. A server that still runs after this time is killed.
constexpr std::chrono::seconds kStopLimit{5};
constexpr int kSupervisorFd = 3;

Error Failed(const std::string& message) {
  return Error(ErrorCode::kUnavailable, "PRIVATE_SERVER_FAILED", message);
}

// Waits for a child to end and reaps it; false if it still runs after `limit`.
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

// A directory that only this user can enter, with a path short enough for a socket's name (108 bytes).
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

bool IsExecutable(const std::string& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
}

}  // namespace

inline namespace abi0 {

std::string FindPlanishd(const std::string& directory) {
  std::vector<fs::path> candidates;
  if (!directory.empty()) candidates = {fs::path(directory) / "planishd", fs::path(directory) / "../bin/planishd"};
  if (const char* named = std::getenv("PLANISHD"); named != nullptr && *named != '\0') {
    candidates.emplace_back(named);
  } else if (const char* path = std::getenv("PATH"); path != nullptr) {
    const std::vector<std::string> entries = absl::StrSplit(path, ':', absl::SkipEmpty());
    for (const std::string& entry : entries) candidates.push_back(fs::path(entry) / "planishd");
  }
  const auto found = std::find_if(candidates.begin(), candidates.end(), IsExecutable);
  return found == candidates.end() ? "" : found->lexically_normal();
}

struct PrivateServer::State {
  std::string executable;
  std::string directory;
  std::string target;
  Descriptor supervisor;  // planishd holds the other end, and reads end of file from it once this process is gone
  pid_t pid = -1;

  ~State() {
    supervisor = Descriptor();
    if (pid > 0 && !ReapWithin(pid, kStopLimit)) {
      kill(pid, SIGKILL);
      ReapWithin(pid, kStopLimit);
    }
    std::error_code ignored;
    if (!directory.empty()) fs::remove_all(directory, ignored);
  }

  std::string Log() const {
    std::ifstream in(directory + "/log", std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::string LogSuffix() const {
    const std::string log = Log(), text(absl::StripTrailingAsciiWhitespace(log));
    return text.empty() ? "" : "\n" + text;
  }

  void Start(const PrivateServerOptions& options) {
    directory = NewPrivateDirectory();
    target = "unix:" + directory + "/socket";
    int sockets[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0) {
      throw Failed(std::string("socketpair: ") + std::strerror(errno));
    }
    supervisor = Descriptor(sockets[0]);
    Descriptor theirs(sockets[1]);
    NewProcess planishd;
    planishd.program = executable;
    planishd.arguments = {executable, "--listen=" + target, "--supervisor-fd=" + std::to_string(kSupervisorFd),
                          "--workers=" + std::to_string(options.workers), "--log-level=warn"};
    if (options.threads > 0) planishd.arguments.push_back("--threads=" + std::to_string(options.threads));
    planishd.arguments.insert(planishd.arguments.end(), options.extra_arguments.begin(), options.extra_arguments.end());
    for (char** entry = environ; *entry != nullptr; ++entry) {
      if (!std::string_view(*entry).starts_with(kServiceVariables)) planishd.variables.emplace_back(*entry);
    }
    const Descriptor log(open((directory + "/log").c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600));
    planishd.descriptors = {-1, -1, log.get(), theirs.get()};  // the last one is kSupervisorFd
    planishd.own_group = true;
    const int error = Spawn(planishd, &pid);
    if (error != 0) throw Failed("cannot start " + executable + ": " + std::strerror(error));
    theirs = Descriptor();
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

PrivateServer::PrivateServer(const PrivateServerOptions& options) : state_(std::make_shared<State>()) {
  state_->executable =
      options.executable.empty() ? FindPlanishd(fs::path(SelfPath()).parent_path()) : options.executable;
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
