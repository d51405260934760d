#include "core/io/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "core/base/status_macros.h"
#include "core/io/file_error.h"

namespace planish {
namespace {

class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  int value() const { return value_; }

 private:
  int value_;
};

// Reads up to the end of the file, however long its size says it is: pipes have none. At most `limit` bytes.
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
  // A FIFO that nobody writes to must not hold us up before we know what it is.
  const Descriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC | (regular_only ? O_NONBLOCK : 0)));
  if (descriptor.value() < 0) return FileUnreadable(path, "cannot open", errno);
  struct stat status;
  if (::fstat(descriptor.value(), &status) != 0) return FileUnreadable(path, "cannot open", errno);
  if (S_ISDIR(status.st_mode)) return FileUnreadable(path, "cannot read", EISDIR);
  if (regular_only && !S_ISREG(status.st_mode)) return FileUnreadable(path, "not a regular file", EINVAL);
  return ReadAll(path, descriptor.value(), static_cast<std::size_t>(status.st_size), limit);
}

}  // namespace

absl::StatusOr<std::string> ReadWholeFile(const std::string& path) {
  return Read(path, false, SIZE_MAX / 4);
}

absl::StatusOr<std::string> ReadFileStart(const std::string& path, std::int64_t size) {
  return Read(path, true, static_cast<std::size_t>(std::max<std::int64_t>(size, 0)));
}

}  // namespace planish
