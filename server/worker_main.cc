#include "server/worker_main.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/heap.h"
#include "server/link/descriptor_link.h"
#include "server/link/rpc_status.h"
#include "server/link/worker_arguments.h"
#include "server/worker/process_memory.h"
#include "server/worker/sandbox.h"
#include "server/worker/warm_up.h"
#include "server/worker/work.h"
#include "server/worker/worker.h"

namespace planish {
namespace {

constexpr int kCannotWork = 3;
constexpr int kOutOfMemory = 4;

// The link and the prepared message for the handler below, which cannot allocate memory.
int link_fd = -1;
std::string* last_words = nullptr;

bool IsOutOfMemory() {
  try {
    if (const std::exception_ptr exception = std::current_exception()) std::rethrow_exception(exception);
  } catch (const std::bad_alloc&) {
    return true;
  } catch (const std::system_error& error) {
    return error.code() == std::errc::resource_unavailable_try_again;
  } catch (...) {
  }
  return false;
}

// The terminate handler. If memory runs out on a helper thread, where nobody can catch the exception, the job still
// ends with OUT_OF_MEMORY. Any other exception is a bug, and aborts.
[[noreturn]] void EndWithoutMemory() {
  if (!IsOutOfMemory()) std::abort();
  [[maybe_unused]] const ssize_t written = write(link_fd, last_words->data(), last_words->size());
  _exit(kOutOfMemory);
}

void PrepareLastWords(int fd) {
  worker::v1::FromWorker message;
  *message.mutable_result()->mutable_status() = ToRpcStatus(OutOfMemory());
  link_fd = fd;
  last_words = new std::string(ToFrame(message));
  std::set_terminate(EndWithoutMemory);
}

// Whether the server is gone: it may have died before ConfineProcess() tied this process to it.
bool IsAlone(int fd) {
  pollfd source = {fd, 0, 0};
  return poll(&source, 1, 0) > 0 && (source.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0;
}

// Sends a header that announces more bytes than a message may have.
void SendGarbage() {
  const std::string garbage(64, '\xff');
  [[maybe_unused]] const ssize_t written = write(link_fd, garbage.data(), garbage.size());
}

// Switches stderr from the file that the server reads after a failed start to the descriptor for running workers.
// Returns that file.
Descriptor SwitchStderr(int stderr_fd) {
  if (stderr_fd < 0) return Descriptor();
  Descriptor words(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0));
  dup2(stderr_fd, STDERR_FILENO);
  close(stderr_fd);
  return words;
}

int Run(const WorkerArguments& arguments) {
  ConfineProcess();
  if (IsAlone(arguments.fd)) return kCannotWork;
  KeepFreedMemory();
  WatchProcessMemory();
  PrepareLastWords(arguments.fd);
  const absl::StatusOr<std::unique_ptr<ServerLink>> server = ConnectToServer(Descriptor(arguments.fd));
  if (!server.ok()) return kCannotWork;
  WarmUp();

  WorkerSettings settings;
  settings.owns_process = true;
  settings.failpoints = arguments.failpoints;
  settings.send_garbage = SendGarbage;
  const Descriptor words = SwitchStderr(arguments.stderr_fd);  // before the sandbox, which would refuse this
  if (arguments.sandbox != SandboxMode::kOff) {
    const absl::Status sandbox = EnterSandbox();
    if (!sandbox.ok() && arguments.sandbox == SandboxMode::kRequire) {
      const std::string why = absl::StrCat("planishd: no sandbox for a worker: ", sandbox.message(), "\n");
      const int fd = words.get() >= 0 ? words.get() : STDERR_FILENO;
      [[maybe_unused]] const ssize_t written = write(fd, why.data(), why.size());
      return kCannotWork;
    }
    settings.idle.set_sandboxed(sandbox.ok());
    settings.idle.set_sandbox_error(std::string(sandbox.message()));
  }
  ServeJobs(**server, settings);
  return EXIT_SUCCESS;
}

}  // namespace

std::optional<int> RunIfWorker(int argc, char** argv) {
  const std::optional<WorkerArguments> arguments = ParseWorkerArguments(argc, argv);
  if (!arguments.has_value()) return std::nullopt;
  const int code = Run(*arguments);
  // Runs no destructors: libraries may make calls that the sandbox refuses, and nothing is left to save.
  _exit(code);
}

}  // namespace planish
