#include "server/store/sql_schema.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

absl::Status TakeSteps(SqlConnection& sql, std::string_view group, const std::vector<std::string_view>& steps) {
  PLANISH_RETURN_IF_ERROR(sql.Serialize({"planish schema"}));
  PLANISH_RETURN_IF_ERROR(
      sql.Run("CREATE TABLE IF NOT EXISTS table_groups (name TEXT PRIMARY KEY, version BIGINT NOT NULL)", {}).status());
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql.Run("SELECT version FROM table_groups WHERE name = ?", {group}));
  const std::int64_t version = rows.empty() ? 0 : rows.Int(0, 0);
  const auto known = static_cast<std::int64_t>(steps.size());
  PLANISH_RETURN_IF_ERROR(CheckStepsAhead(group, version, known));
  for (std::int64_t i = version; i < known; ++i) {
    const std::string_view step = steps[static_cast<std::size_t>(i)];
    for (const absl::string_view statement :
         absl::StrSplit(absl::string_view(step.data(), step.size()), ';', absl::SkipWhitespace())) {
      PLANISH_RETURN_IF_ERROR(sql.Run(std::string(statement), {}).status());
    }
  }
  if (version >= known) return absl::OkStatus();
  return sql
      .Run("INSERT INTO table_groups VALUES (?, ?) ON CONFLICT (name) DO UPDATE SET version = excluded.version",
           {group, known})
      .status();
}

}  // namespace

absl::Status CheckStepsAhead(std::string_view what, std::int64_t found, std::int64_t known) {
  if (found <= known + 1) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_VERSION",
                   absl::StrCat("the database was set up by a newer planish (its version of ", std::string(what),
                                " is ", found, ", this one works with up to ", known + 1,
                                "): use that one, or another database. Servers of one release and the next may run "
                                "side by side; upgrade them release by release"));
}

absl::Status SetUpTables(SqlDatabase* database, std::string_view group, const std::vector<std::string_view>& steps) {
  return Transact(database, Durability::kNow, [&](SqlConnection& sql) { return TakeSteps(sql, group, steps); });
}

}  // namespace planish
