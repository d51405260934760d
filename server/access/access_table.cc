#include "server/access/access_table.h"

#include <utility>

#include "absl/strings/ascii.h"
#include "core/base/error.h"

namespace planish {
namespace {

absl::StatusOr<Caller> Admit(const Credential& credential, absl::Time now) {
  if (now >= credential.expires) {
    return MakeError(absl::StatusCode::kUnauthenticated, "CREDENTIALS_EXPIRED",
                     "these credentials have expired: ask the operator of the server for new ones");
  }
  return Caller{credential.tenant, credential.label, credential.rights, ""};
}

}  // namespace

absl::Status CredentialsInvalid() {
  return MakeError(absl::StatusCode::kUnauthenticated, "CREDENTIALS_INVALID",
                   "this server does not know these credentials");
}

AccessTable::AccessTable(std::map<std::string, TenantLimits> tenants, std::vector<Credential> credentials)
    : tenants_(std::move(tenants)) {
  for (Credential& credential : credentials) {
    switch (credential.kind) {
      case Credential::Kind::kToken:
        tokens_.push_back(std::move(credential));
        break;
      case Credential::Kind::kCertificate:
        certificates_.emplace(credential.certificate, credential);
        break;
      case Credential::Kind::kUser:
        users_.emplace(credential.user, credential);
        break;
    }
  }
}

absl::StatusOr<Caller> AccessTable::FindToken(std::string_view token, absl::Time now) const {
  const TokenDigest digest = DigestOf(token);
  const Credential* found = nullptr;
  for (const Credential& credential : tokens_) {
    if (IsEqual(credential.digest, digest)) found = &credential;
  }
  if (found == nullptr || token.empty()) return CredentialsInvalid();
  return Admit(*found, now);
}

absl::StatusOr<Caller> AccessTable::FindCertificate(const std::vector<std::string>& names, absl::Time now) const {
  for (const std::string& name : names) {
    const auto found = certificates_.find(absl::AsciiStrToLower(name));
    if (found != certificates_.end()) return Admit(found->second, now);
  }
  return CredentialsInvalid();
}

absl::StatusOr<Caller> AccessTable::FindUser(std::uint32_t uid, absl::Time now) const {
  const auto found = users_.find(uid);
  if (found == users_.end()) return CredentialsInvalid();
  return Admit(found->second, now);
}

TenantLimits AccessTable::LimitsOf(const std::string& tenant) const {
  const auto found = tenants_.find(tenant);
  return found == tenants_.end() ? TenantLimits() : found->second;
}

}  // namespace planish
