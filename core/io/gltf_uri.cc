#include "core/io/gltf_uri.h"

#include <cctype>
#include <filesystem>

#include "absl/strings/escaping.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/io/read_file.h"

namespace planish {
namespace {

bool IsHex(char c) {
  return std::isxdigit(static_cast<unsigned char>(c)) != 0;
}

// "%20" to " "; a '%' before anything else stays.
std::string Decoded(std::string_view uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && IsHex(uri[i + 1]) && IsHex(uri[i + 2])) {
      text += absl::HexStringToBytes(std::string(uri.substr(i + 1, 2)));
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

// "https:", "file:"; a drive letter is one as well, and no more portable.
bool HasScheme(std::string_view uri) {
  const std::size_t colon = uri.find(':');
  return colon != std::string_view::npos && colon > 0 && uri.substr(0, colon).find_first_of("/?#%") == uri.npos;
}

bool IsRelative(std::string_view uri) {
  return !uri.empty() && !HasScheme(uri) && uri.front() != '/' && uri.front() != '\\';
}

}  // namespace

bool IsDataUri(std::string_view uri) {
  return uri.substr(0, 5) == "data:";
}

std::string DataUri(const std::string& bytes) {
  return "data:application/octet-stream;base64," + absl::Base64Escape(bytes);
}

absl::StatusOr<std::string> LoadGltfUri(const GltfDocument& document, const std::string& element,
                                        const std::string& uri, std::int64_t size) {
  if (IsDataUri(uri)) {
    const std::size_t comma = uri.find(',');
    if (comma == std::string::npos) return GltfFault(document, element, "a data URI needs a comma");
    const std::string_view head = std::string_view(uri).substr(0, comma);
    const std::string_view body = std::string_view(uri).substr(comma + 1);
    if (head.size() < 7 || head.substr(head.size() - 7) != ";base64") return Decoded(body);
    std::string bytes;
    if (!absl::Base64Unescape(std::string(body), &bytes))
      return GltfFault(document, element, "the base64 text is damaged");
    return bytes;
  }
  if (!IsRelative(uri)) {
    return MakeError(absl::StatusCode::kInvalidArgument, "FILE_UNSUPPORTED",
                     document.path + ": " + element + ": only data URIs and files beside this one can be read",
                     {{"path", document.path}, {"element", element}});
  }
  return ReadFileStart((std::filesystem::path(document.path).parent_path() / Decoded(uri)).string(), size);
}

std::string MovedUri(const std::string& uri, const std::string& from, const std::string& to) {
  if (!IsRelative(uri)) return uri;
  namespace fs = std::filesystem;
  const fs::path source = fs::absolute(from).lexically_normal().parent_path();
  const fs::path target = fs::absolute(to).lexically_normal().parent_path();
  if (source == target) return uri;
  const fs::path moved = (source / Decoded(uri)).lexically_normal().lexically_relative(target);
  return moved.empty() ? uri : UriOfFileName(moved.generic_string());
}

std::string UriOfFileName(const std::string& name) {
  std::string uri;
  for (const char c : name) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                          std::string_view("-._~/!$&'()*+,;=@").find(c) != std::string_view::npos;
    if (is_plain) {
      uri += c;
    } else {
      uri += "%" + absl::BytesToHexString(std::string(1, c));
    }
  }
  return uri;
}

}  // namespace planish
