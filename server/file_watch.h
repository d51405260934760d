// Detects changes of files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace planish {

// Watches files that are read together, by their times, sizes and inodes. Symbolic links are followed, so a changed
// link is a change (Kubernetes swaps a whole directory in this way). Not thread-safe.
class FileWatch {
 public:
  // The present state of the files counts as known.
  explicit FileWatch(std::vector<std::string> files);

  // Whether the files differ from the known state and have not changed since the last call. So it waits for a file that
  // is still being written, or for the second of two files that belong together. If true, the present state becomes the
  // known one.
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
  std::vector<Stamp> seen_;  // the state at the last call
};

}  // namespace planish
