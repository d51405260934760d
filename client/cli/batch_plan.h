// The plan of a batch, digests of its inputs and settings, and the record that lets the next run continue.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/descriptor.h"
#include "planish/error.h"

namespace planish::cli {

struct UnwrapArguments;

// ---- The plan: what `planish unwrap a.obj b.glb dir/ -o out/` will do. It is complete before any job runs.
//
// Every file given as an argument, and every mesh file in a directory given as an argument, becomes one job and one
// output. The output of a file given as an argument lies in the output directory itself. A file found in a directory
// has the same path below the output directory as below that directory.

struct BatchItem {
  std::string name;    // for people: path below the directory given as an argument, or the file's own name
  std::string input;   // path to read
  std::string key;     // path below the output directory; different for all items without a problem
  std::string output;  // path to write
  std::int64_t bytes = 0;
  int texcoord = 0;              // BatchFiles::texcoord for a glTF, 0 for others
  std::optional<Error> problem;  // why the item will fail, e.g. it is no mesh file, or a directory cannot be read
};

struct BatchPlan {
  std::vector<BatchItem> items;  // in the order of the arguments; the files of a directory sorted by their paths
  // Number of directory entries that were skipped, by kind: ".mtl", "without extension", "hidden", "link to a
  // directory", "output directory".
  std::map<std::string, int> skipped;
};

// The files of a batch.
struct BatchFiles {
  std::vector<std::string> inputs;  // files and directories, at least one
  std::string output;               // a directory
  std::string format;               // as UnwrapArguments::format
  int texcoord = 0;
};

// Makes the plan. Throws planish::Error: BATCH_OUTPUT_CONFLICT if two outputs would have the same path, or an output is
// an input; BATCH_OUTPUT_UNSUPPORTED if the output is not a directory; BATCH_EMPTY if there is no mesh file.
BatchPlan PlanBatch(const BatchFiles& files);

// "Skipped in directories: 12 .mtl, 3 .png, 1 hidden.\n"; empty if nothing was skipped.
std::string SkippedText(const BatchPlan& plan);

// ---- Digests of what a result depends on: bytes and options

// The SHA-256 in hexadecimal of the file `path` together with the files that it refers to: buffers and images of a
// glTF, material files and images of an OBJ. A referenced file that cannot be read counts as missing. Throws
// planish::Error: FILE_UNREADABLE if `path` cannot be read.
std::string InputDigest(const std::string& path);

// The SHA-256 in hexadecimal of one file's bytes; empty if it cannot be read.
std::string FileDigest(const std::string& path);

// The SHA-256 in hexadecimal of all options that change a byte of the output (so not of `threads`).
std::string SettingsDigest(const UnwrapArguments& arguments);

// ---- The record of a batch, from which the next run continues
//
// OUT/.planish-batch.json has one JSON object per line. A line is appended when the outputs of a file are written; with
// --detach, before a job is requested and when it is queued; and when a queued job turns out to have failed. The last
// line about an output counts. An incomplete line, which a killed run leaves, is ignored.

inline constexpr char kBatchStateFile[] = ".planish-batch.json";

struct BatchRecord {
  std::string key;  // BatchItem::key
  // Digests of all that the result depends on. The record applies to a run only if all three are equal.
  std::string input;
  std::string settings;
  std::string version;  // of planish and planishd: "0.1.0 0.1.0"

  std::string job;         // the file's job; empty: none yet
  bool queued = false;     // the job is queued on `server`, and its result is not fetched yet
  std::string server;      // address of the server, for a job that is queued or requested
  std::string request_id;  // of a job that was requested from `server`, while the answer is not known; else empty

  // The members below are only for a file that is done.
  bool usable = false;
  std::string why;  // why the map is not usable; empty if it is
  std::int64_t triangles = 0;
  int charts = 0;
  double seconds = 0;
  std::map<std::string, std::string> files;  // SHA-256 of each file written, by its path below the output directory

  bool IsOf(const BatchRecord& other) const {
    return key == other.key && input == other.input && settings == other.settings && version == other.version;
  }
};

// Converts a record to one line without line break, and back. ParseRecord() returns nothing for a malformed line.
std::string ToLine(const BatchRecord& record);
std::optional<BatchRecord> ParseRecord(const std::string& line);

// Thread-safe.
class BatchState {
 public:
  // Reads and locks the record in `directory`, or creates it. Throws planish::Error: BATCH_RUNNING if another batch has
  // locked it; FILE_UNWRITABLE.
  explicit BatchState(const std::string& directory);

  std::optional<BatchRecord> Find(const std::string& key) const;
  // Throws FILE_UNWRITABLE.
  void Append(const BatchRecord& record);
  // Whether the record is that of a done file, and its outputs have the same bytes as when they were written.
  bool IsIntact(const BatchRecord& record) const;

 private:
  const std::string directory_;
  const std::string path_;
  Descriptor file_;
  mutable std::mutex mutex_;  // guards what follows
  bool torn_ = false;         // the file does not end with a line break
  std::map<std::string, BatchRecord> records_;
};

}  // namespace planish::cli
