#include "server/store/sql.h"

#include <algorithm>
#include <bit>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// (?, ?), (?, ?), ...
std::string Places(std::size_t rows, std::size_t columns) {
  const std::string row = absl::StrCat("(", absl::StrJoin(std::vector<const char*>(columns, "?"), ", "), ")");
  return absl::StrJoin(std::vector<std::string>(rows, row), ", ");
}

}  // namespace

absl::Status StoreUnavailable(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "the job store: " + why);
}

namespace {

absl::Status TransactOnce(SqlDatabase* database, Durability durability,
                          const std::function<absl::Status(SqlConnection&)>& body) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database->Connect(SqlDatabase::Use::kWrite));
  absl::Status status = connection->Begin(durability);
  if (status.ok()) status = body(*connection);
  if (status.ok()) status = connection->Commit();
  if (!status.ok()) connection->Rollback();
  return status;
}

}  // namespace

absl::Status Transact(SqlDatabase* database, Durability durability,
                      const std::function<absl::Status(SqlConnection&)>& body) {
  constexpr int kMostAttempts = 8;  // room that is freed may be taken by others first
  for (int attempt = 1;; ++attempt) {
    absl::Status status = TransactOnce(database, durability, body);
    const bool is_full = !status.ok() && ErrorInfoOf(status).reason == "STORAGE_FULL";
    if (!is_full || attempt == kMostAttempts || !database->GiveUpReserve()) return status;
  }
}

RowBatch RowBatch::Of(std::string statement) {
  return RowBatch([statement = std::move(statement)](std::size_t rows, std::size_t columns) {
    return absl::StrReplaceAll(statement, {{"{rows}", Places(rows, columns)}});
  });
}

RowBatch RowBatch::Update(const std::string& table, const std::vector<std::string>& columns, const std::string& key) {
  return RowBatch([=](std::size_t rows, std::size_t) {
    std::vector<std::string> settings;
    for (const std::string& column : columns) {
      settings.push_back(absl::StrCat(column, " = ", rows == 1 ? "?" : absl::StrCat("v.column", settings.size() + 1)));
    }
    const std::string update = absl::StrCat("UPDATE ", table, " SET ", absl::StrJoin(settings, ", "));
    if (rows == 1) return absl::StrCat(update, " WHERE ", key, " = ?");
    return absl::StrCat(update, " FROM (VALUES ", Places(rows, columns.size() + 1), ") AS v WHERE ", key, " = v.column",
                        columns.size() + 1);
  });
}

RowBatch RowBatch::Select(std::string select) {
  const Text text = [select = std::move(select)](std::size_t rows, std::size_t) {
    return absl::StrJoin(std::vector<std::string>(rows, select), " UNION ALL ");
  };
  return RowBatch(text, kMostSelects);
}

void RowBatch::Add(const std::vector<SqlValue>& row) {
  std::vector<SqlValue>& copy = rows_.emplace_back(row);
  for (SqlValue& value : copy) {
    if (const auto* text = std::get_if<std::string_view>(&value)) value = std::string_view(bytes_.emplace_back(*text));
    if (const auto* bytes = std::get_if<SqlBytes>(&value)) value = SqlBytes{bytes_.emplace_back(bytes->bytes)};
  }
}

absl::Status RowBatch::Send(SqlConnection* sql, std::deque<SqlRows>* answers) {
  for (std::size_t begin = 0, count = 0; begin < rows_.size(); begin += count) {
    // Sends a power of two of rows at a time, since each different number needs a prepared statement.
    count = std::bit_floor(std::min(rows_.size() - begin, most_));
    std::vector<SqlValue> values;
    for (std::size_t i = begin; i < begin + count; ++i) values.insert(values.end(), rows_[i].begin(), rows_[i].end());
    SqlRows* const answer = answers == nullptr ? nullptr : &answers->emplace_back();
    PLANISH_RETURN_IF_ERROR(sql->RunLater(text_(count, rows_[begin].size()), values, answer));
  }
  rows_.clear();
  bytes_.clear();
  return absl::OkStatus();
}

std::string ReplaceWords(std::string_view sql, const std::function<std::string(std::string_view word)>& replace) {
  std::string text;
  while (!sql.empty()) {
    const std::size_t begin = sql.find('{');
    text += sql.substr(0, begin);
    if (begin == std::string_view::npos) break;
    const std::size_t end = sql.find('}', begin);
    text += replace(sql.substr(begin + 1, end - begin - 1));
    sql.remove_prefix(end + 1);
  }
  return text;
}

}  // namespace planish
