#include "core/base/read_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/descriptor.h"

namespace planish {

absl::StatusOr<std::string> ReadTextFile(const std::string& what, const std::string& path) {
  // Uses no streams, since they do not say what went wrong and report an empty file as a failure.
  const auto error = [&](int number) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot read ", what, " ", path, ": ", std::generic_category().message(number)));
  };
  const Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return error(errno);
  std::string text;
  char part[16384];
  while (true) {
    const ssize_t count = read(file.get(), part, sizeof part);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return error(errno);
    if (count == 0) return text;
    text.append(part, static_cast<std::size_t>(count));
  }
}

}  // namespace planish
