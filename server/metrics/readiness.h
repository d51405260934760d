#pragma once

#include <map>
#include <mutex>
#include <string>

namespace planish {

// What keeps a server from taking new jobs. Thread-safe.
class Readiness {
 public:
  enum class Obstacle { kStarting, kEnding, kDraining, kWorkers, kStore, kUpkeep };

  // kStarting is in the way.
  Readiness();

  // `why`, for people; empty: it is no longer in the way.
  void Set(Obstacle obstacle, std::string why);

  // All that is in the way, in the order of the enum, separated by "; ". Empty: ready.
  std::string WhyNot() const;

 private:
  mutable std::mutex mutex_;
  std::map<Obstacle, std::string> obstacles_;  // guarded by mutex_
};

}  // namespace planish
