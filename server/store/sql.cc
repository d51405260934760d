#include "server/store/sql.h"

#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {

absl::Status StoreUnavailable(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "the job store: " + why);
}

absl::Status Transact(SqlDatabase* database, Durability durability,
                      const std::function<absl::Status(SqlConnection&)>& body) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database->Connect(SqlDatabase::Use::kWrite));
  absl::Status status = connection->Begin(durability);
  if (status.ok()) status = body(*connection);
  if (status.ok()) status = connection->Commit();
  if (!status.ok()) connection->Rollback();
  return status;
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
