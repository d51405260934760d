// Free space on the disk of a data directory, and a reserve for when there is none.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "absl/time/time.h"

namespace planish {

// Two amounts. The headroom is at most an eighth of the file system:
//   headroom  stays free of new meshes, so that jobs that were accepted can end and have their results kept
//   reserve   a file of a quarter of the headroom, released a quarter at a time when the disk is full nevertheless:
//             SQLite writes its log even to delete rows or to open the database
// Thread-safe.
class DiskRoom {
 public:
  // `directory` must exist. The reserve is the file `reserve` in it; an earlier server may have left one. Creates it if
  // there is room.
  DiskRoom(std::string directory, std::int64_t headroom_bytes);

  // How many bytes must be freed before `more` bytes can be stored without using the headroom; 0 or less: none.
  std::int64_t Shortage(std::int64_t more) const;

  // Whether there is room for results.
  bool HasRoomForResults() const;

  // Releases a part of the reserve. False if none is left.
  bool GiveUpReserve();

  // Refills the reserve if there is room. Call it from time to time.
  void Tick();

  std::int64_t headroom_bytes() const { return headroom_; }
  std::int64_t reserve_bytes() const;  // bytes of the reserve that are left

 private:
  const std::string directory_, reserve_path_;
  std::int64_t headroom_ = 0;
  std::int64_t whole_reserve_ = 0;
  mutable std::mutex mutex_;  // held while the file is changed
};

}  // namespace planish
