// Files read and written whole, and errors about files worded for the person who has to mend them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

// INVALID_ARGUMENT, FILE_MALFORMED: "path:line: message" with metadata "line"; line 0 means that the fault has none
// ("path: message").
absl::Status FileMalformed(const std::string& path, std::int64_t line, const std::string& message);

// "path: message: text of the errno value `error_number`". The first is NOT_FOUND, PERMISSION_DENIED or UNAVAILABLE
// with FILE_UNREADABLE, the second PERMISSION_DENIED or UNAVAILABLE with FILE_UNWRITABLE.
absl::Status FileUnreadable(const std::string& path, const std::string& message, int error_number);
absl::Status FileUnwritable(const std::string& path, const std::string& message, int error_number);

// `token` in quotation marks, fit for a terminal: cut off after 40 bytes, unprintable bytes as '?'.
std::string Quoted(std::string_view token);

// Everything up to the end of the file, be it a pipe; "-" is stdin. Errors: FileUnreadable().
absl::StatusOr<std::string> ReadWholeFile(const std::string& path);

// The first `size` bytes of a regular file, or all of a shorter one: what another file claims about it is not believed,
// and devices and pipes are FILE_UNREADABLE.
absl::StatusOr<std::string> ReadFileStart(const std::string& path, std::int64_t size);

// Writes `bytes` to `path` so that a reader sees the old file or the whole new one (temporary file beside it, and
// rename). Permissions of an old file stay, a read-only one is refused, symbolic links are followed. "-" and
// /dev/stdout are stdout; pipes and devices are written in place.
// PERMISSION_DENIED or UNAVAILABLE: FILE_UNWRITABLE, with the system's own words; no temporary file is left.
absl::Status WriteFile(const std::string& path, const std::string& bytes);

}  // namespace planish
