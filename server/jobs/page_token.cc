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

std::string Filter(const PageList& list) {
  return absl::StrCat(static_cast<int>(list.state), ".", absl::WebSafeBase64Escape(list.label_prefix));
}

}  // namespace

std::string EncodePageToken(const PageList& list, std::int64_t before_number) {
  return absl::WebSafeBase64Escape(absl::StrCat(list.store, ":", Filter(list), ":", before_number));
}

absl::StatusOr<std::int64_t> DecodePageToken(const std::string& token, const PageList& list) {
  if (token.empty()) return 0;
  std::string text;
  if (!absl::WebSafeBase64Unescape(token, &text)) return Invalid("page_token is not one of this server's");
  const std::vector<std::string> parts = absl::StrSplit(text, ':');
  std::int64_t number = 0;
  if (parts.size() != 3 || parts[0] != list.store || !absl::SimpleAtoi(parts[2], &number) || number <= 0) {
    return Invalid("page_token is not one of this server's");
  }
  if (parts[1] != Filter(list)) return Invalid("page_token belongs to a list with another filter");
  return number;
}

}  // namespace planish
