// Reads and writes whole files, with errors that say how to fix the problem.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

// INVALID_ARGUMENT, FILE_MALFORMED: "path:line: message" with metadata "line"; line 0 means no line ("path: message").
absl::Status FileMalformed(const std::string& path, std::int64_t line, const std::string& message);

// "path: message: text of the errno value `error_number`". FileUnreadable is NOT_FOUND, PERMISSION_DENIED or
// UNAVAILABLE with FILE_UNREADABLE; FileUnwritable is PERMISSION_DENIED or UNAVAILABLE with FILE_UNWRITABLE.
absl::Status FileUnreadable(const std::string& path, const std::string& message, int error_number);
absl::Status FileUnwritable(const std::string& path, const std::string& message, int error_number);

// `token` in quotation marks, safe for a terminal: cut off after 40 bytes, unprintable bytes as '?'.
std::string Quoted(std::string_view token);

// All bytes up to the end of the file or pipe; "-" is stdin. Errors: FileUnreadable().
absl::StatusOr<std::string> ReadWholeFile(const std::string& path);

// The first `size` bytes of a regular file, or all of a shorter one. Devices and pipes are FILE_UNREADABLE, since the
// name may come from an untrusted file.
absl::StatusOr<std::string> ReadFileStart(const std::string& path, std::int64_t size);

// Writes `bytes` to `path` atomically: a reader sees the old file or the whole new one (a temporary file beside it, and
// a rename). Keeps the permissions of an old file, refuses a read-only one, and follows symbolic links. "-" and
// /dev/stdout are stdout; pipes and devices are written in place. A failure is FileUnwritable(), with the system's
// message, and leaves no temporary file.
absl::Status WriteFile(const std::string& path, const std::string& bytes);

}  // namespace planish
