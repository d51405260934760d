// Errors about files, worded for the person who has to mend the file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"

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

}  // namespace planish
