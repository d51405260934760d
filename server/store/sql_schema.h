// Tables beside those of JobStore, each group with its own versions.
#pragma once

#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "server/store/sql.h"

namespace planish {

// Takes the steps that `group` (a fixed word) still lacks in the database, one process at a time; each step is one
// statement. Never change a step that was released: add another. FAILED_PRECONDITION with STORE_VERSION if a newer
// version of planish took more steps than there are here; errors of SqlConnection.
absl::Status SetUpTables(SqlDatabase* database, std::string_view group, const std::vector<std::string_view>& steps);

}  // namespace planish
