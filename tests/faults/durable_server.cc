#include "tests/faults/durable_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace planish {
namespace {

namespace fs = std::filesystem;

constexpr int kSupervisorFd = 3;
constexpr int kStartMilliseconds = 20'000;

std::string ReadText(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// Of /proc/PID/status; 0 if there is none.
std::int64_t StatusNumber(pid_t pid, const std::string& key) {
  std::istringstream status(ReadText("/proc/" + std::to_string(pid) + "/status"));
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(key + ":", 0) == 0) return std::stoll(line.substr(key.size() + 1));
  }
  return 0;
}

char StateOf(pid_t pid) {
  const std::string stat = ReadText("/proc/" + std::to_string(pid) + "/stat");
  const std::size_t name_end = stat.rfind(')');
  return name_end == std::string::npos ? '?' : stat[name_end + 2];
}

std::vector<pid_t> ChildrenOf(pid_t pid) {
  std::vector<pid_t> children;
  std::error_code error;
  for (const auto& thread : fs::directory_iterator("/proc/" + std::to_string(pid) + "/task", error)) {
    std::istringstream pids(ReadText(thread.path() / "children"));
    for (pid_t child = 0; pids >> child;) children.push_back(child);
  }
  return children;
}

}  // namespace

DurableServer::DurableServer(std::string directory, std::vector<std::string> flags)
    : directory_(std::move(directory)), flags_(std::move(flags)), target_("unix:" + directory_ + "/socket") {
  fs::create_directories(directory_);
  Start();
}

DurableServer::~DurableServer() {
  if (pid_ > 0) Kill();
}

void DurableServer::Start() {
  std::vector<std::string> arguments = {PLANISHD, "--listen=" + target_, "--data-dir=" + directory_ + "/data",
                                        "--supervisor-fd=" + std::to_string(kSupervisorFd)};
  arguments.insert(arguments.end(), flags_.begin(), flags_.end());
  int sockets[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0) throw std::runtime_error("socketpair");
  OwnedFd ours(sockets[0]), theirs(sockets[1]);
  const OwnedFd log(open((directory_ + "/log").c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600));
  pid_ = Spawn(arguments, log.get(), theirs.get(), kSupervisorFd);
  theirs.Reset();
  pollfd wait = {ours.get(), POLLIN, 0};
  char said[8];
  if (poll(&wait, 1, kStartMilliseconds) != 1 || read(ours.get(), said, sizeof said) <= 0) {
    throw std::runtime_error("planishd did not start:\n" + Log());
  }
  supervisor_ = std::move(ours);
}

int DurableServer::Reap() {
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

void DurableServer::Kill() {
  kill(pid_, SIGKILL);
  Reap();
}

int DurableServer::Terminate() {
  kill(pid_, SIGTERM);
  return Reap();
}

bool DurableServer::IsRunning() {
  if (pid_ <= 0) return false;
  if (waitpid(pid_, nullptr, WNOHANG) == 0) return true;
  pid_ = -1;
  return false;
}

std::vector<pid_t> DurableServer::Workers() const {
  std::vector<pid_t> workers = ChildrenOf(pid_);
  std::erase_if(workers, [](pid_t child) { return StateOf(child) == 'Z'; });
  return workers;
}

int DurableServer::Zombies() const {
  int zombies = 0;
  for (const pid_t child : ChildrenOf(pid_)) zombies += StateOf(child) == 'Z' ? 1 : 0;
  return zombies;
}

int DurableServer::Descriptors() const {
  int count = 0;
  std::error_code error;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator("/proc/" + std::to_string(pid_) + "/fd", error)) {
    ++count;
  }
  return count;
}

std::int64_t DurableServer::ResidentBytes() const {
  return 1024 * StatusNumber(pid_, "VmRSS");
}

int DurableServer::BlobFiles() const {
  int count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(directory_ + "/data/blobs")) {
    count += entry.is_regular_file() ? 1 : 0;
  }
  return count;
}

std::string DurableServer::Log() const {
  return ReadText(directory_ + "/log");
}

}  // namespace planish
