// Maps credentials of callers to tenants and rights.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/access/caller.h"
#include "server/access/tenant.h"
#include "server/access/token_digest.h"

namespace planish {

struct Credential {
  enum class Kind { kToken, kCertificate, kUser };

  Kind kind = Kind::kToken;
  TokenDigest digest = {};  // kToken
  std::string certificate;  // kCertificate: a DNS name, lower case
  std::uint32_t user = 0;   // kUser: a uid

  std::string label;  // Caller::credential
  std::string tenant;
  Rights rights;
  absl::Time expires = absl::InfiniteFuture();
};

// UNAUTHENTICATED with CREDENTIALS_INVALID. The message is always the same, so that it does not help those who guess.
absl::Status CredentialsInvalid();

// Immutable, so threads may share it. Each Find returns the caller, CredentialsInvalid(), or UNAUTHENTICATED with
// CREDENTIALS_EXPIRED if `now` is not before Credential::expires.
class AccessTable {
 public:
  // Every credential's tenant is one of `tenants`, and no two credentials are the same.
  AccessTable(std::map<std::string, TenantLimits> tenants, std::vector<Credential> credentials);

  // Compares all tokens, so that the time does not reveal which ones are similar.
  absl::StatusOr<Caller> FindToken(std::string_view token, absl::Time now) const;

  // `names`: the names in a certificate. The first known name counts. Case is ignored.
  absl::StatusOr<Caller> FindCertificate(const std::vector<std::string>& names, absl::Time now) const;

  absl::StatusOr<Caller> FindUser(std::uint32_t uid, absl::Time now) const;

  // The tenant's limits; the default ones if the file does not list the tenant.
  TenantLimits LimitsOf(const std::string& tenant) const;

  const std::map<std::string, TenantLimits>& tenants() const { return tenants_; }
  std::size_t credentials() const { return tokens_.size() + certificates_.size() + users_.size(); }

 private:
  std::map<std::string, TenantLimits> tenants_;
  std::vector<Credential> tokens_;
  std::map<std::string, Credential> certificates_;
  std::map<std::uint32_t, Credential> users_;
};

}  // namespace planish
