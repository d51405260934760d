// Blobs as objects of a bucket, on AWS or any server with the S3 protocol.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/blobs/blob_store.h"
#include "server/blobs/s3_client.h"

namespace planish {

struct S3BlobsOptions {
  S3Options s3;
  // A blob of at least this age is copied when it is put again or renewed; a younger one is not.
  absl::Duration renew_age = BlobStore::kReferenceTime / 4;
};

// A blob is the object TENANT/SHA256/COPY, where COPY is a random number that is never used again. Renewing a blob
// makes another copy, and deleting it removes the old copies that were found, so neither needs a lock: a new copy is
// never removed because of an old one's age. Two concurrent puts of the same blob leave two copies, which count as one
// blob.
class S3BlobStore : public BlobStore {
 public:
  // Sends the server one request. Errors of S3Client.
  static absl::StatusOr<std::unique_ptr<S3BlobStore>> Make(S3BlobsOptions options);

  absl::StatusOr<bool> Renew(const BlobId& id) override;
  absl::StatusOr<bool> Has(const BlobId& id) override;
  absl::Status List(const std::function<void(const BlobEntry&)>& visit) override;
  absl::StatusOr<bool> Remove(const BlobId& id, absl::Duration min_age) override;
  bool is_shared() const override { return true; }

 protected:
  absl::StatusOr<Found> OpenUnverified(const BlobId& id) override;
  absl::StatusOr<std::string> PutNew(const BlobId& id, std::string_view bytes) override;
  absl::Status Drop(const BlobId& id, const std::string& version) override;

 private:
  explicit S3BlobStore(S3BlobsOptions options)
      : options_(std::move(options)), client_(std::make_shared<S3Client>(options_.s3)) {}

  // All copies, the youngest first.
  absl::StatusOr<std::vector<S3Object>> CopiesOf(const BlobId& id);

  const S3BlobsOptions options_;
  const std::shared_ptr<S3Client> client_;  // open blobs share it
};

}  // namespace planish
