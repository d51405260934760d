#include "tests/testing/daemon.h"

#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace planish {

namespace fs = std::filesystem;

Daemon::Daemon(std::vector<std::string> flags, bool supervised) {
  flags.insert(flags.begin(), PLANISHD_COMMAND);
  ProcessOptions options;
  options.merged = true;
  if (!supervised) {
    process_ = std::make_unique<Process>(std::move(flags), options);
    return;
  }
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error("socketpair");
  supervisor_ = ends[0];
  options.inherited_fd = ends[1];
  flags.push_back("--supervisor-fd=" + std::to_string(ends[1]));
  process_ = std::make_unique<Process>(std::move(flags), options);
  close(ends[1]);
}

Daemon::~Daemon() {
  CloseSupervisor();
}

bool Daemon::WaitReady() {
  char said[16];
  return read(supervisor_, said, sizeof said) == 6 && std::string(said, 6) == "ready\n";
}

void Daemon::CloseSupervisor() {
  if (supervisor_ >= 0) close(std::exchange(supervisor_, -1));
}

std::string Daemon::ReadUntil(const std::string& text) {
  process_->WaitForErr(text, 60);
  return Output();
}

DurableServer::DurableServer(std::string directory, std::vector<std::string> flags)
    : directory_(std::move(directory)), flags_(std::move(flags)), target_("unix:" + directory_ + "/socket") {
  fs::create_directories(directory_);
  Start();
}

void DurableServer::Start() {
  std::vector<std::string> flags = {"--listen=" + target_, "--data-dir=" + directory_ + "/data"};
  flags.insert(flags.end(), flags_.begin(), flags_.end());
  if (daemon_ != nullptr) past_log_ += daemon_->Output();
  daemon_ = std::make_unique<Daemon>(std::move(flags), true);
  if (!daemon_->WaitReady()) throw std::runtime_error("planishd did not start:\n" + Log());
}

void DurableServer::Kill() {
  daemon_->Signal(SIGKILL);
  daemon_->Wait();
}

int DurableServer::Terminate() {
  daemon_->Signal(SIGTERM);
  return daemon_->Wait();
}

std::vector<pid_t> DurableServer::Workers() const {
  std::vector<pid_t> workers = ChildrenOf(daemon_->pid());
  std::erase_if(workers, [](pid_t child) { return StateOf(child) == 'Z'; });
  return workers;
}

int DurableServer::Zombies() const {
  int zombies = 0;
  for (const pid_t child : ChildrenOf(daemon_->pid())) zombies += StateOf(child) == 'Z' ? 1 : 0;
  return zombies;
}

int DurableServer::Descriptors() const {
  int count = 0;
  std::error_code error;
  for ([[maybe_unused]] const auto& entry :
       fs::directory_iterator("/proc/" + std::to_string(daemon_->pid()) + "/fd", error)) {
    ++count;
  }
  return count;
}

std::int64_t DurableServer::ResidentBytes() const {
  std::ifstream status("/proc/" + std::to_string(daemon_->pid()) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return 1024 * std::stoll(line.substr(6));
  }
  return 0;
}

int DurableServer::BlobFiles() const {
  int count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(directory_ + "/data/blobs")) {
    count += entry.is_regular_file() ? 1 : 0;
  }
  return count;
}

}  // namespace planish
