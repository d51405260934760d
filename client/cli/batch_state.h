// What a batch has done, in a file beside its outputs, so that the next run need not do it again.
//
// OUT/.planish-batch.json holds one JSON object per line, appended when a file is done (after its outputs are in
// place), before a job that is to outlive the run is asked for and once it is queued, or when such a job turns out to
// have failed. The last line about an output counts. A line that a killed run left half written is no line.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "client/src/process.h"

namespace planish::cli {

inline constexpr char kBatchStateFile[] = ".planish-batch.json";

struct BatchRecord {
  std::string key;  // BatchItem::key
  // What the result depends on (batch_digest.h): a record says something about a run only if all three are its own.
  std::string input;
  std::string settings;
  std::string version;  // of planish and planishd: "0.1.0 0.1.0"

  std::string job;         // the job that did it, or
  bool queued = false;     // that will do it, on
  std::string server;      // this server
  std::string request_id;  // with which a job was asked for there, if the answer is not known; else empty

  // Of one that is done.
  bool usable = false;
  std::string why;  // it is not usable
  std::int64_t triangles = 0;
  int charts = 0;
  double seconds = 0;
  std::map<std::string, std::string>
      files;  // below the output directory, and the SHA-256 of what was written; empty: nothing

  bool IsOf(const BatchRecord& other) const {
    return key == other.key && input == other.input && settings == other.settings && version == other.version;
  }
};

// One line, without line break; and back. Nothing for what is no record.
std::string ToLine(const BatchRecord& record);
std::optional<BatchRecord> ParseRecord(const std::string& line);

// Thread-safe.
class BatchState {
 public:
  // Reads and locks the file in `directory`, or creates it. Throws planish::Error: BATCH_RUNNING if another batch has
  // it; FILE_UNREADABLE, FILE_UNWRITABLE.
  explicit BatchState(const std::string& directory);

  std::optional<BatchRecord> Find(const std::string& key) const;
  // Throws FILE_UNWRITABLE.
  void Append(const BatchRecord& record);
  // Whether every file of the record is there, as it was written.
  bool IsIntact(const BatchRecord& record) const;

 private:
  const std::string directory_;
  const std::string path_;
  OwnedFd file_;
  mutable std::mutex mutex_;  // guards what follows
  bool torn_ = false;         // the file does not end with a line break
  std::map<std::string, BatchRecord> records_;
};

}  // namespace planish::cli
