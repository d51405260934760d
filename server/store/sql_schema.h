// Versions of groups of tables: JobStore's and others, each group with its own version.
//
// The rule of rolling upgrades. Servers of two consecutive releases share one database: the newer ones have migrated
// it, and the older ones keep working. So
// - a release adds at most one step to each group of tables, and a step never changes after its release;
// - a step is compatible with the statements of the previous release. It may add tables, indexes, and columns that have
//   a default. What it no longer needs (a column, a table, a name, a type, a constraint) stays in place: the step of
//   the next release drops it, when no server uses it any more;
// - statements name the columns that they read, since there may be more.
// A program that is two steps behind refuses to start.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "server/store/sql.h"

namespace planish {

// Whether a program that knows `known` steps may use tables after `found` steps: FAILED_PRECONDITION with STORE_VERSION
// if they are more than one step ahead. `what` names the tables in the message.
absl::Status CheckStepsAhead(std::string_view what, std::int64_t found, std::int64_t known);

// Applies the steps that `group` (a fixed word) still lacks, one process at a time. A step is a series of statements,
// each ended by a semicolon and containing no other. Errors of CheckStepsAhead() and of SqlConnection.
absl::Status SetUpTables(SqlDatabase* database, std::string_view group, const std::vector<std::string_view>& steps);

}  // namespace planish
