// SQLite with statuses and without leaks.
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

// A compiled statement. Use: Bind() all parameters in order, Step() until it says false, Reset(). Not thread-safe.
class Statement {
 public:
  Statement() = default;

  // The next parameter; text and blobs are copied.
  Statement& Bind(std::int64_t value);
  Statement& BindText(std::string_view value);
  Statement& BindBlob(std::string_view value);
  Statement& BindNull();

  // Whether there is a row. Errors: RESOURCE_EXHAUSTED with STORAGE_FULL where the disk is full, INTERNAL otherwise.
  absl::StatusOr<bool> Step();
  // Columns of the present row, from 0.
  std::int64_t Int(int column) const;
  std::string Bytes(int column) const;
  bool IsInt(int column) const;
  int columns() const;

  // Ready to be bound again.
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

// One connection. Not thread-safe.
class Database {
 public:
  // `path` is created if need be; ":memory:" lives as long as the object.
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
