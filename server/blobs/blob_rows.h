// Small blobs as rows of the database that holds the records.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "server/blobs/blob_store.h"
#include "server/blobs/stored_blob.h"

namespace planish {

// A small blob that JobStore's verbs commit with a record, which saves the syncs of a file and its folder.
struct BlobRow {
  BlobId id;
  StoredBlobPtr bytes;  // in memory
};

// The committed rows. Thread-safe.
class BlobRows {
 public:
  // Blobs up to this size become rows.
  static constexpr std::int64_t kMostBytes = std::int64_t{256} << 10;

  virtual ~BlobRows() = default;

  // The ids and sizes, in bytes, of all rows.
  virtual absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> List() = 0;
  // The bytes of a row. NOT_FOUND with BLOB_NOT_FOUND if there is no such row.
  virtual absl::StatusOr<std::string> Read(const BlobId& id) = 0;
  // Removes the row unless a record needs the blob. Returns whether there is no row with this id any more.
  virtual absl::StatusOr<bool> Remove(const BlobId& id) = 0;
};

}  // namespace planish
