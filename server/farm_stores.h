#pragma once

#include "absl/status/statusor.h"
#include "server/stores.h"

namespace planish {

// FarmOpener for PostgreSQL, with blobs in the same database, in S3, or in a directory.
absl::StatusOr<FarmStores> OpenFarmStores(const ServerFlags& flags);

}  // namespace planish
