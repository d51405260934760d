// A database whose connection dies when a test says.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "server/store/sql.h"

namespace planish {

// What goes wrong. Counts every statement, the beginning and the end of transactions among them.
struct Fault {
  int at = 0;                                          // this one, counted from 1, fails; 0: none
  bool answers = true;                                 // false: what fails was done, only the answer is lost
  bool full = false;                                   // every write is refused: STORAGE_FULL
  bool away = false;                                   // likewise: STORE_UNAVAILABLE
  int count = 0;                                       // so far
  int commits = 0;                                     // likewise
  std::function<void(const std::string& sql)> before;  // each statement
};

class FailingConnection : public SqlConnection {
 public:
  FailingConnection(SqlConnection* connection, Fault* fault) : connection_(*connection), fault_(*fault) {}

  absl::Status Begin(Durability durability) override {
    if (fault_.away) return StoreUnavailable("it is away");
    if (fault_.full) return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", "no room");
    return Try([&] { return connection_.Begin(durability); });
  }
  absl::Status Commit() override {
    std::atomic_ref(fault_.commits).fetch_add(1);
    return Try([&] { return connection_.Commit(); });
  }
  // Also what the server does with the transactions of a connection that died.
  void Rollback() override { connection_.Rollback(); }
  absl::StatusOr<SqlRows> Run(const std::string& sql, const std::vector<SqlValue>& values) override {
    absl::StatusOr<SqlRows> rows = SqlRows();
    if (fault_.before != nullptr) fault_.before(sql);
    const absl::Status status = Try([&] {
      rows = connection_.Run(sql, values);
      return rows.status();
    });
    if (!status.ok()) return status;
    return rows;
  }
  absl::Status RunLater(const std::string& sql, const std::vector<SqlValue>& values, SqlRows* rows) override {
    if (fault_.before != nullptr) fault_.before(sql);
    return Try([&] { return connection_.RunLater(sql, values, rows); });
  }
  absl::Status Flush() override {
    return Try([&] { return connection_.Flush(); });
  }
  absl::Status TakeTurn(std::uint64_t number) override {
    return Try([&] { return connection_.TakeTurn(number); });
  }
  bool HasTurn() const override { return connection_.HasTurn(); }
  std::int64_t Slot() const override { return connection_.Slot(); }
  absl::Status Serialize(const std::vector<std::string>& keys) override { return connection_.Serialize(keys); }
  absl::StatusOr<bool> TrySerialize(std::string_view key) override { return connection_.TrySerialize(key); }

 private:
  absl::Status Try(const std::function<absl::Status()>& body) {
    const bool fails = std::atomic_ref(fault_.count).fetch_add(1) + 1 == fault_.at;  // crowds have several connections
    if (fails && fault_.answers) dead_ = true;
    if (dead_) return StoreUnavailable("the connection died");
    const absl::Status status = body();
    if (!fails || !status.ok()) return status;
    dead_ = true;
    return StoreUnavailable("the connection died before the answer came");
  }

  SqlConnection& connection_;
  Fault& fault_;
  bool dead_ = false;
};

class FailingDatabase : public SqlDatabase {
 public:
  // `fault` outlives the object.
  FailingDatabase(std::unique_ptr<SqlDatabase> database, Fault* fault)
      : database_(std::move(database)), fault_(*fault) {}

  absl::StatusOr<Lease> Connect(Use use) override {
    absl::StatusOr<Lease> connection = database_->Connect(use);
    if (!connection.ok() || use == Use::kRead) return connection;
    // The deleter of the outer one holds the inner one.
    auto inner = std::make_shared<Lease>(*std::move(connection));
    return Lease(new FailingConnection(inner->get(), &fault_), [inner](SqlConnection* outer) {
      delete outer;
      inner->reset();
    });
  }
  void Publish(std::string_view message) override { database_->Publish(message); }
  void Listen(std::function<void(std::string_view message)> listener) override {
    database_->Listen(std::move(listener));
  }
  void SetProcesses(int all, int must_hear) override { database_->SetProcesses(all, must_hear); }
  bool hears() const override { return database_->hears(); }
  const std::string& id() const override { return database_->id(); }
  bool has_clock() const override { return database_->has_clock(); }
  bool is_shared() const override { return database_->is_shared(); }
  bool outlives_process() const override { return database_->outlives_process(); }

 private:
  const std::unique_ptr<SqlDatabase> database_;
  Fault& fault_;
};

}  // namespace planish
