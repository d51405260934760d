// Whole files into memory.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace planish {

// Everything up to the end of the file, be it a pipe. FILE_UNREADABLE as in file_error.h.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path);

// The first `size` bytes of a regular file, or all of a shorter one: what another file claims about it is not believed,
// and devices and pipes are FILE_UNREADABLE.
absl::StatusOr<std::string> ReadFileStart(const std::string& path, std::int64_t size);

}  // namespace planish
