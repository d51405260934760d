#include "client/files/file_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <map>
#include <system_error>

#include "core/base/descriptor.h"
#include "core/base/error.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

absl::Status SystemError(const std::string& path, const std::string& reason, const std::string& message,
                         int error_number, absl::StatusCode code_unless_denied) {
  const bool denied = error_number == EACCES || error_number == EPERM || error_number == EROFS;
  const std::string text = std::error_code(error_number, std::generic_category()).message();
  return MakeError(denied ? absl::StatusCode::kPermissionDenied : code_unless_denied, reason,
                   path + ": " + message + ": " + text, {{"path", path}});
}

}  // namespace

absl::Status FileMalformed(const std::string& path, std::int64_t line, const std::string& message) {
  std::map<std::string, std::string> metadata = {{"path", path}};
  std::string where = path;
  if (line > 0) {
    metadata["line"] = std::to_string(line);
    where += ":" + std::to_string(line);
  }
  return MakeError(absl::StatusCode::kInvalidArgument, "FILE_MALFORMED", where + ": " + message, metadata);
}

absl::Status FileUnreadable(const std::string& path, const std::string& message, int error_number) {
  const bool is_missing = error_number == ENOENT || error_number == ENOTDIR;
  return SystemError(path, "FILE_UNREADABLE", message, error_number,
                     is_missing ? absl::StatusCode::kNotFound : absl::StatusCode::kUnavailable);
}

absl::Status FileUnwritable(const std::string& path, const std::string& message, int error_number) {
  return SystemError(path, "FILE_UNWRITABLE", message, error_number, absl::StatusCode::kUnavailable);
}

std::string Quoted(std::string_view token) {
  constexpr std::size_t kLongest = 40;
  std::string quoted = "\"";
  for (const char c : token.substr(0, kLongest)) quoted += c >= ' ' && c <= '~' ? c : '?';
  if (token.size() > kLongest) quoted += "...";
  return quoted + "\"";
}

namespace {

// Reads up to the end of the file, but at most `limit` bytes. The size `expected` is only a guess: pipes have no size.
absl::StatusOr<std::string> ReadAll(const std::string& path, int descriptor, std::size_t expected, std::size_t limit) {
  std::string bytes;
  std::size_t size = 0;
  while (size < limit) {
    if (size == bytes.size()) bytes.resize(std::min(limit, size == 0 ? expected + 1 : 2 * size));
    const ssize_t count = ::read(descriptor, bytes.data() + size, bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return FileUnreadable(path, "cannot read", errno);
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
  }
  bytes.resize(size);
  return bytes;
}

absl::StatusOr<std::string> Read(const std::string& path, bool regular_only, std::size_t limit) {
  // O_NONBLOCK, since opening a FIFO without a writer would wait for one.
  const Descriptor descriptor(path == "-"
                                  ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
                                  : ::open(path.c_str(), O_RDONLY | O_CLOEXEC | (regular_only ? O_NONBLOCK : 0)));
  if (descriptor.get() < 0) return FileUnreadable(path, "cannot open", errno);
  struct stat status;
  if (::fstat(descriptor.get(), &status) != 0) return FileUnreadable(path, "cannot open", errno);
  if (S_ISDIR(status.st_mode)) return FileUnreadable(path, "cannot read", EISDIR);
  if (regular_only && !S_ISREG(status.st_mode)) return FileUnreadable(path, "not a regular file", EINVAL);
  return ReadAll(path, descriptor.get(), static_cast<std::size_t>(status.st_size), limit);
}

}  // namespace

absl::StatusOr<std::string> ReadWholeFile(const std::string& path) {
  return Read(path, false, SIZE_MAX / 4);
}

absl::StatusOr<std::string> ReadFileStart(const std::string& path, std::int64_t size) {
  return Read(path, true, static_cast<std::size_t>(std::max<std::int64_t>(size, 0)));
}

namespace {

constexpr char kCannotWrite[] = "cannot write";

// Returns an errno value; 0 if all bytes were written.
int WriteAll(int descriptor, const std::string& bytes) {
  std::size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t count = ::write(descriptor, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    written += static_cast<std::size_t>(count);
  }
  return 0;
}

// The open descriptor that `path` names, or -1. Open descriptors are written directly: /dev/stdout may be a file that
// the shell opened, which must not be replaced by another file of the same name.
int DescriptorOf(const std::string& path) {
  if (path == "-" || path == "/dev/stdout") return STDOUT_FILENO;
  if (path == "/dev/stderr") return STDERR_FILENO;
  for (const std::string prefix : {"/dev/fd/", "/proc/self/fd/"}) {
    std::int64_t descriptor = 0;
    if (path.substr(0, prefix.size()) == prefix && ParseInt(path.substr(prefix.size()), &descriptor) &&
        descriptor >= 0 && descriptor <= INT32_MAX) {
      return static_cast<int>(descriptor);
    }
  }
  return -1;
}

// The final target of the symbolic link `path`, whether or not it exists; `path` itself if it is not a link. Sets
// `error_number` if a link cannot be read or there are more than 40 links, as in a cycle.
std::string FollowLinks(const std::string& path, int* error_number) {
  constexpr int kMostLinks = 40;  // the limit of Linux
  std::filesystem::path target = path;
  std::error_code error;
  for (int i = 0; i < kMostLinks; ++i) {
    if (!std::filesystem::is_symlink(target, error)) return target.string();
    const std::filesystem::path link = std::filesystem::read_symlink(target, error);
    if (error) {
      *error_number = error.value();
      return path;
    }
    // If `link` is absolute, operator/ drops the folder before it.
    target = target.parent_path() / link;
  }
  *error_number = ELOOP;
  return path;
}

// Writes to a device or pipe, which cannot be replaced. Returns an errno value; 0 if all bytes were written.
int WriteInPlace(const std::string& path, const std::string& bytes) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int error_number = WriteAll(descriptor, bytes);
  return ::close(descriptor) != 0 && error_number == 0 ? errno : error_number;
}

// Opens a new file in the folder of `target` and sets `name`. Returns the descriptor, or -1 with errno.
int OpenTemporary(const std::filesystem::path& target, std::string* name) {
  static std::atomic<int> serial = 0;
  while (true) {
    const std::string file = ".planish-" + std::to_string(::getpid()) + "-" + std::to_string(serial++) + ".tmp";
    *name = (target.parent_path() / file).string();
    const int descriptor = ::open(name->c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    // A killed process with the same number left a file of this name.
    if (descriptor < 0 && errno == EEXIST) continue;
    return descriptor;
  }
}

int Replace(const std::string& target, const std::string& bytes, const struct stat* existing) {
  std::string temporary;
  const int descriptor = OpenTemporary(target, &temporary);
  if (descriptor < 0) return errno;
  int error_number = WriteAll(descriptor, bytes);
  if (error_number == 0 && existing != nullptr && ::fchmod(descriptor, existing->st_mode & 0777) != 0) {
    error_number = errno;
  }
  if (::close(descriptor) != 0 && error_number == 0) error_number = errno;
  if (error_number == 0 && ::rename(temporary.c_str(), target.c_str()) != 0) error_number = errno;
  if (error_number != 0) ::unlink(temporary.c_str());
  return error_number;
}

}  // namespace

absl::Status WriteFile(const std::string& path, const std::string& bytes) {
  if (const int descriptor = DescriptorOf(path); descriptor >= 0) {
    const int error_number = WriteAll(descriptor, bytes);
    if (error_number == 0) return absl::OkStatus();
    return FileUnwritable(path == "-" ? "stdout" : path, kCannotWrite, error_number);
  }

  int error_number = path.empty() ? ENOENT : 0;
  const std::string target = FollowLinks(path, &error_number);
  struct stat existing;
  const bool exists = error_number == 0 && ::stat(target.c_str(), &existing) == 0;
  if (error_number != 0) {
    // The error is reported below.
  } else if (!exists) {
    error_number = Replace(target, bytes, nullptr);
  } else if (S_ISDIR(existing.st_mode)) {
    error_number = EISDIR;
  } else if (!S_ISREG(existing.st_mode)) {
    error_number = WriteInPlace(target, bytes);
  } else if (::faccessat(AT_FDCWD, target.c_str(), W_OK, AT_EACCESS) != 0) {
    // Renaming would replace a read-only file.
    error_number = errno;
  } else {
    error_number = Replace(target, bytes, &existing);
  }
  if (error_number == 0) return absl::OkStatus();
  return FileUnwritable(path, kCannotWrite, error_number);
}

}  // namespace planish
