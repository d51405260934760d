#include "core/io/file_error.h"

#include <cerrno>
#include <map>
#include <system_error>

#include "core/base/error.h"

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

}  // namespace planish
