#include "server/metrics/readiness.h"

#include <utility>

#include "absl/strings/str_join.h"

namespace planish {

Readiness::Readiness() : obstacles_({{Obstacle::kStarting, "the server is starting"}}) {}

void Readiness::Set(Obstacle obstacle, std::string why) {
  const std::lock_guard lock(mutex_);
  if (why.empty()) {
    obstacles_.erase(obstacle);
  } else {
    obstacles_[obstacle] = std::move(why);
  }
}

std::string Readiness::WhyNot() const {
  const std::lock_guard lock(mutex_);
  return absl::StrJoin(obstacles_, "; ", [](std::string* out, const auto& entry) { out->append(entry.second); });
}

}  // namespace planish
