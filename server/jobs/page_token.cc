#include "server/jobs/page_token.h"

#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/error.h"

namespace planish {
namespace {

absl::Status Invalid(const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", "page_token"}});
}

}  // namespace

std::string EncodePageToken(const PagePosition& position) {
  return absl::WebSafeBase64Escape(
      absl::StrCat(position.instance, ":", static_cast<int>(position.state), ":", position.before_number));
}

absl::StatusOr<std::int64_t> DecodePageToken(const std::string& token, const std::string& instance,
                                             v1::JobState state) {
  if (token.empty()) return 0;
  std::string text;
  if (!absl::WebSafeBase64Unescape(token, &text)) return Invalid("page_token is not one of this server's");
  const std::vector<std::string> parts = absl::StrSplit(text, ':');
  std::int64_t number = 0;
  if (parts.size() != 3 || parts[0] != instance || !absl::SimpleAtoi(parts[2], &number) || number <= 0) {
    return Invalid("page_token is not one of this server's");
  }
  if (parts[1] != absl::StrCat(static_cast<int>(state))) {
    return Invalid("page_token belongs to a list with another state");
  }
  return number;
}

}  // namespace planish
