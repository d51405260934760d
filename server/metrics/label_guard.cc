#include "server/metrics/label_guard.h"

#include <algorithm>

#include "absl/strings/ascii.h"

namespace planish {

std::string LabelGuard::Reason(const std::string& reason) {
  constexpr std::size_t kLongest = 64;
  if (reason.empty()) return "NONE";
  const bool is_one = reason.size() <= kLongest && std::all_of(reason.begin(), reason.end(), [](unsigned char c) {
                        return absl::ascii_isupper(c) || absl::ascii_isdigit(c) || c == '_';
                      });
  if (!is_one) return "OTHER";
  const std::lock_guard lock(mutex_);
  if (known_.contains(reason)) return reason;
  if (known_.size() >= most_) return "OTHER";
  known_.insert(reason);
  return reason;
}

}  // namespace planish
