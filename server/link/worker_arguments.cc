#include "server/link/worker_arguments.h"

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace planish {
namespace {

constexpr absl::string_view kFd = "--worker-fd=";
constexpr absl::string_view kStderr = "--stderr-fd=";
constexpr absl::string_view kSandbox = "--sandbox=";
constexpr absl::string_view kFailpoints = "--failpoints";
constexpr SandboxMode kModes[] = {SandboxMode::kAuto, SandboxMode::kRequire, SandboxMode::kOff};

}  // namespace

const char* NameOf(SandboxMode mode) {
  switch (mode) {
    case SandboxMode::kAuto:
      return "auto";
    case SandboxMode::kRequire:
      return "require";
    case SandboxMode::kOff:
      return "off";
  }
  return "";
}

std::vector<std::string> ToCommandLine(const WorkerArguments& arguments) {
  std::vector<std::string> line = {absl::StrCat(kFd, arguments.fd), absl::StrCat(kSandbox, NameOf(arguments.sandbox))};
  if (arguments.stderr_fd >= 0) line.push_back(absl::StrCat(kStderr, arguments.stderr_fd));
  if (arguments.failpoints) line.emplace_back(kFailpoints);
  return line;
}

std::optional<WorkerArguments> ParseWorkerArguments(int argc, const char* const* argv) {
  if (argc < 2 || !absl::StartsWith(argv[1], kFd)) return std::nullopt;
  WorkerArguments arguments;
  for (int i = 1; i < argc; ++i) {
    absl::string_view text = argv[i];
    if (absl::ConsumePrefix(&text, kFd)) {
      if (!absl::SimpleAtoi(text, &arguments.fd)) arguments.fd = -1;
    } else if (absl::ConsumePrefix(&text, kStderr)) {
      if (!absl::SimpleAtoi(text, &arguments.stderr_fd)) arguments.stderr_fd = -1;
    } else if (absl::ConsumePrefix(&text, kSandbox)) {
      for (const SandboxMode mode : kModes) {
        if (text == NameOf(mode)) arguments.sandbox = mode;
      }
    } else if (text == kFailpoints) {
      arguments.failpoints = true;
    }
  }
  return arguments;
}

}  // namespace planish
