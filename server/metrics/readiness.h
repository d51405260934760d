#pragma once

#include <map>
#include <mutex>
#include <string>

namespace planish {

// What keeps a server from taking new jobs. Thread-safe.
class Readiness {
 public:
  enum class Obstacle { kStarting, kEnding, kDraining, kWorkers, kStore, kUpkeep };

  // Begins with the obstacle kStarting.
  Readiness();

  // Sets the reason for people; an empty one removes the obstacle.
  void Set(Obstacle obstacle, std::string why);

  // The reasons of all obstacles, in the order of the enum, separated by "; ". Empty if ready.
  std::string WhyNot() const;

 private:
  mutable std::mutex mutex_;
  std::map<Obstacle, std::string> obstacles_;  // guarded by mutex_
};

}  // namespace planish
