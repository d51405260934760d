// A wrapper of SQLite with statuses and ownership.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

struct sqlite3;
struct sqlite3_stmt;

namespace planish {

// A compiled statement. Bind() all parameters in order, call Step() until it returns false, then Reset(). Not
// thread-safe.
class Statement {
 public:
  Statement() = default;

  // Bind the next parameter; text and blobs are copied.
  Statement& Bind(std::int64_t value);
  Statement& BindText(std::string_view value);
  Statement& BindBlob(std::string_view value);
  Statement& BindNull();

  // Whether there is another row. Errors: RESOURCE_EXHAUSTED with STORAGE_FULL if the disk is full, INTERNAL otherwise.
  absl::StatusOr<bool> Step();
  // Columns of the current row, from 0.
  std::int64_t Int(int column) const;
  std::string Bytes(int column) const;
  bool IsInt(int column) const;
  int columns() const;

  // Prepares for new parameters.
  void Reset();

  // Steps to the end, for statements without rows, and resets.
  absl::Status Run();

 private:
  friend class Database;
  struct Finalizer {
    void operator()(sqlite3_stmt* statement) const;
  };
  std::unique_ptr<sqlite3_stmt, Finalizer> statement_;
  int bound_ = 0;
};

// A connection to a database. Not thread-safe.
class Database {
 public:
  // Creates `path` if needed; ":memory:" lives as long as the object.
  static absl::StatusOr<Database> Open(const std::string& path);

  absl::Status Execute(const char* sql);
  absl::StatusOr<Statement> Prepare(const char* sql);

 private:
  struct Closer {
    void operator()(sqlite3* database) const;
  };
  std::unique_ptr<sqlite3, Closer> database_;
};

}  // namespace planish
