// The plan of a batch, digests of its inputs and settings, and the record of earlier runs.
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

// ---- What `planish unwrap a.obj b.glb dir/ -o out/` is about to do: decided in full before anything runs.
//
// Every file that was named, and every mesh file in a directory that was named, becomes one job and one output. The
// output of a named file lies in the output directory itself. A file found in a directory keeps its relative path below
// the output directory.

struct BatchItem {
  std::string name;    // place below the directory that was named, or the file's own name: no two are alike
  std::string input;   // path to read
  std::string key;     // place below the output directory: no two are alike
  std::string output;  // path to write
  std::int64_t bytes = 0;
  int texcoord = 0;              // BatchFiles::texcoord for a glTF, 0 for others
  std::optional<Error> problem;  // why it cannot be done, known already: no mesh file, a directory beyond reading
};

struct BatchPlan {
  std::vector<BatchItem> items;  // in the order of the arguments; the files of a directory sorted by their paths
  // Number of directory entries left out, by kind: ".mtl", "no extension", "hidden", "link to a directory", "output
  // directory".
  std::map<std::string, int> skipped;
};

// The files of a batch.
struct BatchFiles {
  std::vector<std::string> inputs;  // files and directories, at least one
  std::string output;               // a directory
  std::string format;               // as UnwrapArguments::format
  int texcoord = 0;
};

// Looks at the inputs. Throws planish::Error: BATCH_OUTPUT_CONFLICT where two files would
// become one, or an output is an input; BATCH_OUTPUT_UNSUPPORTED where the output is no directory; BATCH_EMPTY where
// there is nothing to do.
BatchPlan PlanBatch(const BatchFiles& files);

// "Skipped in directories: 12 .mtl, 3 .png, 1 hidden.\n"; empty if nothing was.
std::string SkippedText(const BatchPlan& plan);

// ---- Digests of what a result depends on: bytes and options

// The SHA-256 in hexadecimal of the file `path` and of the files that it refers to: buffers and images of a glTF,
// material files and images of an OBJ. Throws planish::Error: FILE_UNREADABLE. A file that it refers to and that cannot
// be read counts as missing.
std::string InputDigest(const std::string& path);

// The SHA-256 in hexadecimal of one file's bytes; empty if it cannot be read.
std::string FileDigest(const std::string& path);

// The SHA-256 in hexadecimal of every option that changes a byte of the output (`threads` does not).
std::string SettingsDigest(const UnwrapArguments& arguments);

// ---- The record of a batch, by which the next run continues it
//
// OUT/.planish-batch.json holds one JSON object per line. A line is appended when the outputs of a file are in place;
// with
// --detach before a job is asked for and when it is queued; and when a queued job turns out to have failed. The last
// line about an output counts. A half line, which a killed run leaves, does not count.

inline constexpr char kBatchStateFile[] = ".planish-batch.json";

struct BatchRecord {
  std::string key;  // BatchItem::key
  // Digests of all that the result depends on. The record applies to a run only if all three are equal.
  std::string input;
  std::string settings;
  std::string version;  // of planish and planishd: "0.1.0 0.1.0"

  std::string job;         // the job that did it, or
  bool queued = false;     // that will do it, on
  std::string server;      // this server
  std::string request_id;  // with which a job was asked for there, if the answer is not known; else empty

  // Only if the file is done.
  bool usable = false;
  std::string why;  // it is not usable
  std::int64_t triangles = 0;
  int charts = 0;
  double seconds = 0;
  std::map<std::string, std::string> files;  // by path below the output directory, the SHA-256 of each file written

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
  Descriptor file_;
  mutable std::mutex mutex_;  // guards what follows
  bool torn_ = false;         // the file does not end with a line break
  std::map<std::string, BatchRecord> records_;
};

}  // namespace planish::cli
