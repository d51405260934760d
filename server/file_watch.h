// Notices that files changed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace planish {

// Files that are read together. Looks at their times, sizes and places; links are followed, so that a link that was
// changed is a change (Kubernetes swaps a whole directory that way). One thread.
class FileWatch {
 public:
  // What the files are like now is what is known.
  explicit FileWatch(std::vector<std::string> files);

  // Whether they changed since they were known last, and have stayed as they are since the last look: a file that is
  // being written, or the second of two that belong together, is waited for. They are known from then on.
  bool Changed();

 private:
  struct Stamp {
    std::uint64_t device = 0, inode = 0;
    std::int64_t size = -1, seconds = 0, nanoseconds = 0;

    bool operator==(const Stamp&) const = default;
  };

  std::vector<Stamp> Look() const;

  const std::vector<std::string> files_;
  std::vector<Stamp> known_;
  std::vector<Stamp> seen_;  // at the last look
};

}  // namespace planish
