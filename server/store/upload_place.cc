#include "server/store/upload_place.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {

std::string UploadName(const std::string& id) {
  return "uploads/" + id;
}

absl::Status UploadNotFound(const std::string& name) {
  return MakeError(absl::StatusCode::kNotFound, "UPLOAD_NOT_FOUND",
                   absl::StrCat("there is no upload '", name, "': it never was, or it expired or was deleted"),
                   {{"upload", name}});
}

absl::Status UploadDigestMismatch(const UploadState& state, const std::string& digest) {
  const std::string name = UploadName(state.id);
  return MakeError(absl::StatusCode::kInvalidArgument, "DIGEST_MISMATCH",
                   absl::StrCat("the bytes of ", name, " have the SHA-256 ", absl::BytesToHexString(digest),
                                " instead of ", absl::BytesToHexString(state.sha256)),
                   {{"upload", name}, {"field", "data"}});
}

absl::Status UploadOffsetMismatch(const UploadState& state, std::int64_t committed_bytes, const std::string& message) {
  return MakeError(absl::StatusCode::kOutOfRange, "UPLOAD_OFFSET_MISMATCH", message,
                   {{"upload", UploadName(state.id)}, {"committed_bytes", absl::StrCat(committed_bytes)}});
}

}  // namespace planish
