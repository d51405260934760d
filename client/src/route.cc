#include "client/src/route.h"

#include <algorithm>

namespace planish {
inline namespace api {
namespace {

constexpr std::size_t kLongestName = 63;

bool MayBeInAName(char c) {
  return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
}

}  // namespace

std::string RouteOf(std::string_view resource) {
  const std::size_t slash = resource.find('/');
  if (slash == std::string_view::npos) return "";
  resource.remove_prefix(slash + 1);
  const std::size_t dot = resource.find('.');
  if (dot == std::string_view::npos || dot > kLongestName) return "";
  const std::string_view name = resource.substr(0, dot);
  return std::all_of(name.begin(), name.end(), MayBeInAName) ? std::string(name) : "";
}

}  // namespace api
}  // namespace planish
