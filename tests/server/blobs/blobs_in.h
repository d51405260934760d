// The blobs of a directory that belongs to the test alone.
#pragma once

#include <memory>
#include <string>

#include "server/blobs/directory_blobs.h"

namespace planish {

// Null, which is memory to a BlobCatalog, if `directory` is empty. Throws absl::BadStatusOrAccess if the directory
// cannot be used.
inline std::shared_ptr<BlobStore> BlobsIn(const std::string& directory, FileLayer* files = FileLayer::System()) {
  if (directory.empty()) return nullptr;
  return DirectoryBlobStore::Make({.directory = directory, .files = files}).value();
}

}  // namespace planish
