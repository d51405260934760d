// The versions of tables, and of tables beside those of JobStore, each group with its own.
//
// The rule of rolling upgrades. Servers of two releases that follow each other share one database: the newer ones have
// taken their steps, the older ones go on. So
// - a release adds at most one step to each group of tables, and a step never changes after its release;
// - a step works with the statements of the release before it. It may add tables, indexes, and columns that have a
//   default. What it no longer needs (a column, a table, a name, a type, a constraint) it leaves in place: the step of
//   the next release drops it, when no server is left that uses it;
// - statements name the columns that they read, since there may be more.
// A program that is two steps behind refuses to start.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "server/store/sql.h"

namespace planish {

// Whether a program that knows `known` steps may use tables on which `found` were taken: FAILED_PRECONDITION with
// STORE_VERSION if they are more than one step ahead. `what` names the tables in the message.
absl::Status CheckStepsAhead(std::string_view what, std::int64_t found, std::int64_t known);

// Takes the steps that `group` (a fixed word) still lacks in the database, one process at a time; a step is
// statements that end with semicolons, without any within. Errors of CheckStepsAhead() and of SqlConnection.
absl::Status SetUpTables(SqlDatabase* database, std::string_view group, const std::vector<std::string_view>& steps);

}  // namespace planish
