// A loss of power, as in LevelDB's fault_injection_test: what was not synced is gone.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <tuple>

namespace planish {

// Watches all calls of fsync(2) and fdatasync(2) of this process, whoever makes them (SQLite too): the program that
// links power_loss.cc has its own versions of both. A sync of a file keeps its bytes of that moment, a sync of a folder
// the names in it. One at a time. Thread-safe.
class PowerLoss {
 public:
  // Watches what is below `root`, an existing folder. What is in it now counts as synced.
  explicit PowerLoss(std::filesystem::path root);
  ~PowerLoss();
  PowerLoss(const PowerLoss&) = delete;
  PowerLoss& operator=(const PowerLoss&) = delete;

  // Calls of fsync and fdatasync below the root so far.
  int syncs() const;

  // Writes into `target`, which is made anew, what would be left of the root if the power failed now: names of folders
  // as of their last sync, and files with their bytes as of their last sync, or half of their bytes if they never were
  // synced.
  void Rescue(const std::filesystem::path& target) const;

  // For the calls themselves.
  static void Synced(int fd);

 private:
  // Device, inode number and time of birth: numbers are used again once a file is removed.
  using Inode = std::tuple<dev_t, ino_t, std::int64_t>;

  static bool Find(const std::filesystem::path& path, Inode* inode, bool* is_folder);

  void Keep(const std::filesystem::path& path);
  void RescueFolder(const std::filesystem::path& folder, const std::filesystem::path& target) const;

  const std::filesystem::path root_;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  int syncs_ = 0;
  std::map<Inode, std::string> files_;                            // bytes as of the last sync
  std::map<std::filesystem::path, std::map<std::string, Inode>> folders_;  // names as of the last sync
  std::map<Inode, std::string> unsynced_;                         // half of the bytes of files that never were synced
};

}  // namespace planish
