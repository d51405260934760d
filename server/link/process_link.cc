#include "server/link/process_link.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/spawn.h"
#include "core/base/status_macros.h"
#include "server/link/frame_socket.h"

namespace planish {
namespace {

using worker::v1::FromWorker;
using worker::v1::ToWorker;

constexpr int kWorkerFd = 3;
constexpr int kStderrFd = 4;
// Longest output of a failed start that is kept.
constexpr std::size_t kMostWords = 4096;
// Variables that the C library, the loader, sanitizers and numerical libraries read.
constexpr std::string_view kVariables[] = {"LANG", "TZ", "GLIBC_TUNABLES", "GCOV_PREFIX", "LLVM_PROFILE_FILE"};
constexpr std::string_view kVariablePrefixes[] = {"LC_",   "LD_",   "MALLOC_", "OMP_",  "OPENBLAS_",
                                                  "ASAN_", "LSAN_", "TSAN_",   "UBSAN_"};
// A worker sends at most one blob: the UV.
constexpr FrameLimits kFromWorker = {.bytes = std::size_t{16} << 20, .descriptors = 1};
// How long a process that closed its link may take to end.
constexpr std::chrono::seconds kExitPatience(2);

absl::Status CannotStart(const std::string& what, int error) {
  const std::string message = absl::StrCat(what, ": ", std::strerror(error));
  if (error == EAGAIN || error == ENOMEM || error == EMFILE || error == ENFILE) {
    return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", message);
  }
  return InternalError(message);
}

// Number of processes that the kernel has killed since the machine started because memory ran out; 0 if it does not
// tell.
std::int64_t KillsForMemory() {
  std::ifstream file("/proc/vmstat");
  std::string name;
  for (std::int64_t count = 0; file >> name >> count;) {
    if (name == "oom_kill") return count;
  }
  return 0;
}

class ProcessWorkerLink : public WorkerLink {
 public:
  // `words`: the file that the worker's stderr goes to until the worker is ready. The caller keeps `stderr_fd`.
  ProcessWorkerLink(pid_t pid, std::unique_ptr<FrameSocket> socket, Descriptor words, int stderr_fd)
      : pid_(pid),
        socket_(std::move(socket)),
        words_(std::move(words)),
        stderr_fd_(stderr_fd),
        kills_before_(KillsForMemory()) {}

  ~ProcessWorkerLink() override {
    Close();
    Reap();
  }

  void Send(ToWorker message, std::vector<BlobPtr> blobs) override {
    socket_->Send(message.SerializeAsString(), std::move(blobs));
  }

  Wait Receive(absl::Time deadline, Received* received) override {
    Frame frame;
    switch (socket_->Receive(deadline, &frame)) {
      case FrameSocket::Wait::kTimeout:
        return Wait::kTimeout;
      case FrameSocket::Wait::kClosed:
        return Wait::kClosed;
      case FrameSocket::Wait::kFrame:
        break;
    }
    words_ = Descriptor();  // the worker is ready
    received->message.Clear();
    received->blob = nullptr;
    if (!received->message.ParseFromString(frame.bytes) ||
        received->message.message_case() == FromWorker::MESSAGE_NOT_SET) {
      return Fault("a message that cannot be parsed");
    }
    if (frame.descriptors.empty()) return Wait::kMessage;
    absl::StatusOr<BlobPtr> blob = Blob::MapSealed(std::move(frame.descriptors[0]));
    if (!blob.ok()) return Fault(std::string(blob.status().message()));
    received->blob = *std::move(blob);
    return Wait::kMessage;
  }

  void Close() override {
    const std::lock_guard lock(mutex_);
    if (reaped_ || given_up_) return;
    given_up_ = true;
    kill(pid_, SIGKILL);
    socket_->Close();
  }

  WorkerLoss HowEnded() override {
    if (fault_.empty()) fault_ = socket_->fault();
    bool given_up;
    {
      const std::lock_guard lock(mutex_);
      given_up = given_up_;
    }
    Reap();
    WorkerLoss loss = Loss(given_up);
    loss.message += LastWords();
    return loss;
  }

 private:
  WorkerLoss Loss(bool given_up) const {
    if (!fault_.empty()) return {"INTERNAL", "the worker broke the protocol: it sent " + fault_, {}};
    if (given_up) return {"WORKER_HUNG", "the worker was given up and killed", {}};
    if (hung_after_closing_) return {"WORKER_HUNG", "the worker closed its link and continued; it was killed", {}};
    const std::string message = "the worker " + HowItEnded(status_);
    if (WIFSIGNALED(status_)) {
      const std::string name = SignalName(WTERMSIG(status_));
      if (WTERMSIG(status_) == SIGKILL && KillsForMemory() > kills_before_) {
        return {"OUT_OF_MEMORY", message + " as the machine's memory ran out", {{"signal", name}}};
      }
      return {"WORKER_CRASHED", message, {{"signal", name}}};
    }
    return {"WORKER_CRASHED", message, {{"exit_code", absl::StrCat(WEXITSTATUS(status_))}}};
  }

  // The output of a worker that never became ready; empty if it was ready. Also copies it to the stderr of the other
  // workers.
  std::string LastWords() {
    if (words_.get() < 0) return "";
    std::string words(kMostWords, '\0');
    const off_t size = lseek(words_.get(), 0, SEEK_END);
    const off_t start = std::max<off_t>(size - static_cast<off_t>(kMostWords), 0);
    const ssize_t count = pread(words_.get(), words.data(), words.size(), start);
    words_ = Descriptor();
    words.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    if (words.empty()) return "";
    [[maybe_unused]] const ssize_t written = write(stderr_fd_, words.data(), words.size());
    while (!words.empty() && words.back() == '\n') words.pop_back();
    return "; it wrote: " + words;
  }

  Wait Fault(const std::string& what) {
    fault_ = what;
    socket_->Close();
    return Wait::kClosed;
  }

  // Waits for the process to end, for a limited time.
  void Reap() {
    const auto patience = std::chrono::steady_clock::now() + kExitPatience;
    std::chrono::microseconds pause(100);
    while (!TryReap()) {
      if (std::chrono::steady_clock::now() > patience) {
        hung_after_closing_ = true;
        kill(pid_, SIGKILL);
      }
      std::this_thread::sleep_for(pause);
      pause = std::min<std::chrono::microseconds>(2 * pause, std::chrono::milliseconds(20));
    }
  }

  bool TryReap() {
    const std::lock_guard lock(mutex_);
    if (reaped_) return true;
    const pid_t pid = waitpid(pid_, &status_, WNOHANG);
    reaped_ = pid == pid_ || (pid < 0 && errno == ECHILD);
    return reaped_;
  }

  const pid_t pid_;
  const std::unique_ptr<FrameSocket> socket_;
  Descriptor words_;  // used by the receiving thread; closed once the worker is ready
  const int stderr_fd_;
  const std::int64_t kills_before_;
  std::string fault_;                // used only by the receiving thread
  bool hung_after_closing_ = false;  // used only by the receiving thread

  std::mutex mutex_;
  // Guarded by mutex_, so that no thread kills a process id that no longer belongs to the worker.
  bool reaped_ = false;
  bool given_up_ = false;
  int status_ = 0;
};

}  // namespace

bool IsForWorkers(std::string_view name) {
  return std::find(std::begin(kVariables), std::end(kVariables), name) != std::end(kVariables) ||
         std::any_of(std::begin(kVariablePrefixes), std::end(kVariablePrefixes),
                     [name](std::string_view prefix) { return name.starts_with(prefix); });
}

absl::StatusOr<std::shared_ptr<WorkerLink>> StartProcessWorker(const WorkerProcessOptions& options) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return CannotStart("socketpair", errno);
  Descriptor ours(ends[0]), theirs(ends[1]);
  PLANISH_ASSIGN_OR_RETURN(std::unique_ptr<FrameSocket> socket, FrameSocket::Make(std::move(ours), kFromWorker));
  WorkerArguments arguments;
  arguments.fd = kWorkerFd;
  arguments.stderr_fd = kStderrFd;
  arguments.sandbox = options.sandbox;
  arguments.failpoints = options.failpoints;
  Descriptor words(memfd_create("planish-worker-words", MFD_CLOEXEC));
  if (words.get() < 0) return CannotStart("memfd_create", errno);
  const int stderr_fd = options.stderr_fd >= 0 ? options.stderr_fd : STDERR_FILENO;
  NewProcess worker;
  worker.program = options.program;
  worker.arguments = ToCommandLine(arguments);
  worker.arguments.insert(worker.arguments.begin(), "planishd-worker");
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    if (IsForWorkers(text.substr(0, text.find('=')))) worker.variables.emplace_back(text);
  }
  worker.descriptors = {-1, -1, words.get(), theirs.get(), stderr_fd};  // kWorkerFd and kStderrFd at the end
  // Ctrl-C and a service manager's SIGTERM reach all processes; a worker ends when its server tells it to.
  worker.blocked_signals = {SIGINT, SIGTERM, SIGHUP};
  pid_t pid = 0;
  const int error = Spawn(worker, &pid);
  if (error != 0) return CannotStart("cannot start " + options.program, error);
  return std::make_shared<ProcessWorkerLink>(pid, std::move(socket), std::move(words), stderr_fd);
}

}  // namespace planish
