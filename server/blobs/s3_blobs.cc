#include "server/blobs/s3_blobs.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "openssl/rand.h"

namespace planish {
namespace {

std::string KeysOf(const BlobId& id) {
  return absl::StrCat(id.tenant, "/", absl::BytesToHexString(id.sha256), "/");
}

absl::StatusOr<std::string> NewCopyName() {
  std::string random(16, '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(random.data()), static_cast<int>(random.size())) != 1) {
    return InternalError("the crypto library has no random bytes");
  }
  return absl::BytesToHexString(random);
}

class ObjectBlob : public StoredBlob {
 public:
  ObjectBlob(std::shared_ptr<S3Client> client, std::string key, std::int64_t size)
      : StoredBlob(size), client_(std::move(client)), key_(std::move(key)) {}

 protected:
  absl::Status ReadRange(std::int64_t offset, std::int64_t length, std::string* bytes) const override {
    return client_->Get(key_, offset, length, bytes);
  }

 private:
  const std::shared_ptr<S3Client> client_;
  const std::string key_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<S3BlobStore>> S3BlobStore::Make(S3BlobsOptions options) {
  std::unique_ptr<S3BlobStore> store(new S3BlobStore(std::move(options)));
  // A query with a known answer, which checks the bucket and the credentials.
  PLANISH_RETURN_IF_ERROR(store->Has({"none", Sha256("")}).status());
  return store;
}

absl::StatusOr<std::vector<S3Object>> S3BlobStore::CopiesOf(const BlobId& id) {
  std::vector<S3Object> copies;
  PLANISH_RETURN_IF_ERROR(client_->List(KeysOf(id), [&](const S3Object& copy) { copies.push_back(copy); }));
  std::stable_sort(copies.begin(), copies.end(), [](const S3Object& a, const S3Object& b) { return a.age < b.age; });
  return copies;
}

absl::StatusOr<BlobStore::Found> S3BlobStore::OpenUnverified(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const std::vector<S3Object> copies, CopiesOf(id));
  if (copies.empty()) return BlobNotFound(id);
  const S3Object& copy = copies.front();
  return Found{std::make_shared<const ObjectBlob>(client_, copy.key, copy.bytes), copy.key};
}

absl::StatusOr<std::string> S3BlobStore::PutNew(const BlobId& id, std::string_view bytes) {
  PLANISH_ASSIGN_OR_RETURN(const std::string name, NewCopyName());
  std::string key = KeysOf(id) + name;
  PLANISH_RETURN_IF_ERROR(client_->Put(key, bytes, id.sha256));
  return key;
}

absl::StatusOr<bool> S3BlobStore::Has(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const std::vector<S3Object> copies, CopiesOf(id));
  return !copies.empty();
}

absl::StatusOr<bool> S3BlobStore::Renew(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const std::vector<S3Object> copies, CopiesOf(id));
  if (copies.empty()) return false;
  if (copies.front().age < options_.renew_age) return true;
  PLANISH_ASSIGN_OR_RETURN(const std::string name, NewCopyName());
  const std::string& source = copies.front().key;
  const absl::Status copied = client_->Copy(source, KeysOf(id) + name);
  if (!copied.ok()) {
    // An object that was removed meanwhile cannot be copied. Some servers answer with 500 instead of NOT_FOUND.
    PLANISH_ASSIGN_OR_RETURN(const std::vector<S3Object> left, CopiesOf(id));
    const bool is_gone =
        std::none_of(left.begin(), left.end(), [&](const S3Object& copy) { return copy.key == source; });
    return is_gone ? absl::StatusOr<bool>(false) : copied;
  }
  // Deletes old copies, which would otherwise accumulate while the blob is in use.
  for (const S3Object& copy : copies) {
    if (copy.age >= kReferenceTime) client_->Delete(copy.key).IgnoreError();  // on failure, the next renewal deletes it
  }
  return true;
}

absl::Status S3BlobStore::List(const std::function<void(const BlobEntry&)>& visit) {
  BlobEntry entry;
  const auto flush = [&] {
    if (!entry.id.sha256.empty()) visit(entry);
  };
  PLANISH_RETURN_IF_ERROR(client_->List("", [&](const S3Object& copy) {
    const std::vector<std::string> parts = absl::StrSplit(copy.key, '/');
    if (parts.size() != 3 || parts[1].size() != 2 * kSha256Bytes) return;  // not a blob of ours
    const BlobId id = {parts[0], absl::HexStringToBytes(parts[1])};
    if (id == entry.id) {
      entry.age = std::min(entry.age, copy.age);
      return;
    }
    flush();
    entry = {id, copy.bytes, copy.age};
  }));
  flush();
  return absl::OkStatus();
}

absl::StatusOr<bool> S3BlobStore::Remove(const BlobId& id, absl::Duration min_age) {
  PLANISH_ASSIGN_OR_RETURN(const std::vector<S3Object> copies, CopiesOf(id));
  // All copies or none: while a young copy keeps the blob, a reader may have an old one open.
  if (!copies.empty() && copies.front().age < min_age) return false;
  for (const S3Object& copy : copies) PLANISH_RETURN_IF_ERROR(client_->Delete(copy.key));
  return true;
}

absl::Status S3BlobStore::Drop(const BlobId&, const std::string& version) {
  return client_->Delete(version);
}

}  // namespace planish
