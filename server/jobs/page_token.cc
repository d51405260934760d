#include "server/jobs/page_token.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"

namespace planish {
namespace {

constexpr std::size_t kNumberBytes = 8;
constexpr std::size_t kSealBytes = 16;

// A keyed hash of the list and the number: making it requires the store's id.
std::string Seal(const PageList& list, std::int64_t number) {
  const std::string text = absl::StrCat("page of ", list.tenant, ":", number, ":", list.filter);
  return Sha256(absl::StrCat(list.store, Sha256(absl::StrCat(list.store, text)))).substr(0, kSealBytes);
}

// Encrypts or decrypts the number's bytes with a key stream that depends on the seal, and so on the number.
std::string Mask(const PageList& list, const std::string& seal, std::string number) {
  const std::string stream = Sha256(absl::StrCat(list.store, "number", seal));
  for (std::size_t i = 0; i < kNumberBytes; ++i) number[i] = static_cast<char>(number[i] ^ stream[i]);
  return number;
}

}  // namespace

std::string EncodePageToken(const PageList& list, std::int64_t before_number) {
  std::string number;
  for (std::size_t i = 0; i < kNumberBytes; ++i) number.push_back(static_cast<char>(before_number >> (8 * i)));
  const std::string seal = Seal(list, before_number);
  return absl::WebSafeBase64Escape(absl::StrCat(seal, Mask(list, seal, number)));
}

absl::StatusOr<std::int64_t> DecodePageToken(const std::string& token, const PageList& list) {
  if (token.empty()) return 0;
  std::string bytes;
  if (absl::WebSafeBase64Unescape(token, &bytes) && bytes.size() == kSealBytes + kNumberBytes) {
    const std::string seal = bytes.substr(0, kSealBytes);
    std::uint64_t number = 0;
    const std::string digits = Mask(list, seal, bytes.substr(kSealBytes));
    for (std::size_t i = 0; i < kNumberBytes; ++i)
      number |= std::uint64_t{static_cast<unsigned char>(digits[i])} << (8 * i);
    if (Seal(list, static_cast<std::int64_t>(number)) == seal) return static_cast<std::int64_t>(number);
  }
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                   "page_token was not made by this server, or belongs to a list with another filter",
                   {{"field", "page_token"}});
}

}  // namespace planish
