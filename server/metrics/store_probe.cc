#include "server/metrics/store_probe.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "server/link/blob.h"

namespace planish {
namespace {

// The probe writes a whole block, since a tiny file may fit where nothing else does.
constexpr std::size_t kBytes = 4096;

absl::Status Refused(const std::string& directory, int error) {
  return absl::UnavailableError(absl::StrCat("cannot write to ", directory, ": ", std::strerror(error)));
}

}  // namespace

absl::Status TryToWrite(const std::string& directory) {
  const std::string path = directory + "/.probe";
  int error = 0;
  {
    const Descriptor file(open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
    if (file.get() < 0) return Refused(directory, errno);
    const std::string bytes(kBytes, '\0');
    const ssize_t written = write(file.get(), bytes.data(), bytes.size());
    if (written != static_cast<ssize_t>(kBytes)) error = written < 0 ? errno : ENOSPC;
  }
  unlink(path.c_str());
  return error == 0 ? absl::OkStatus() : Refused(directory, error);
}

}  // namespace planish
