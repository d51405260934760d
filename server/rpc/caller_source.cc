#include "server/rpc/caller_source.h"

#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "grpc/grpc_security_constants.h"
#include "grpcpp/security/auth_context.h"
#include "server/rpc/tls_files.h"

namespace planish {
namespace {

constexpr char kAuthorization[] = "authorization";
constexpr char kBearer[] = "Bearer ";
constexpr std::uint32_t kRoot = 0;

absl::Status Missing(const std::string& what) {
  return MakeError(absl::StatusCode::kUnauthenticated, "CREDENTIALS_MISSING", what);
}

absl::Status Expired() {
  return MakeError(absl::StatusCode::kUnauthenticated, "CREDENTIALS_EXPIRED",
                   "the certificate of this connection has expired: connect with a new one");
}

Caller DefaultCaller(const std::string& credential) {
  return Caller{kDefaultTenant, credential, Rights::All(), ""};
}

std::string_view View(grpc::string_ref text) {
  return {text.data(), text.size()};
}

// The contents of a verified certificate.
struct Certificate {
  std::vector<std::string> names;
  absl::Time end;
};

std::optional<Certificate> CertificateOf(const grpc::CallbackServerContext& context) {
  const std::shared_ptr<const grpc::AuthContext> auth = context.auth_context();
  if (auth == nullptr || !auth->IsPeerAuthenticated()) return std::nullopt;
  Certificate certificate;
  for (const char* property : {GRPC_PEER_DNS_PROPERTY_NAME, GRPC_X509_CN_PROPERTY_NAME}) {
    if (!certificate.names.empty()) break;
    for (const grpc::string_ref& name : auth->FindPropertyValues(property)) certificate.names.emplace_back(View(name));
  }
  const std::vector<grpc::string_ref> pem = auth->FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  certificate.end = pem.empty() ? absl::InfinitePast() : CertificateEnd(std::string(View(pem[0])));
  return certificate;
}

class OpenCallerSource : public CallerSource {
 public:
  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext&) const override { return DefaultCaller(""); }
};

class RuledCallerSource : public CallerSource {
 public:
  explicit RuledCallerSource(CallerRules rules) : rules_(std::move(rules)) {}

  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const override {
    const std::shared_ptr<const AccessTable> table = rules_.access == nullptr ? nullptr : rules_.access->table();
    if (table != nullptr) {
      const auto [begin, end] = context.client_metadata().equal_range(kAuthorization);
      if (begin != end) return std::next(begin) == end ? ByToken(*table, View(begin->second)) : CredentialsInvalid();
    }
    if (const std::optional<Certificate> certificate = CertificateOf(context)) {
      return ByCertificate(table.get(), *certificate);
    }
    const std::optional<std::uint32_t> user =
        rules_.peers == nullptr ? std::nullopt : rules_.peers->Find(context.peer());
    if (user) return ByUser(table.get(), *user);
    if (table == nullptr) return DefaultCaller("");
    return Missing("this server needs credentials: a token, or a client certificate that it knows");
  }

 private:
  absl::StatusOr<Caller> ByToken(const AccessTable& table, std::string_view authorization) const {
    const absl::string_view text(authorization.data(), authorization.size());
    if (!absl::StartsWithIgnoreCase(text, kBearer)) return CredentialsInvalid();
    return table.FindToken(authorization.substr(sizeof(kBearer) - 1), rules_.now());
  }

  absl::StatusOr<Caller> ByCertificate(const AccessTable* table, const Certificate& certificate) const {
    const absl::Time now = rules_.now();
    // The certificate was valid when the connection was made, and may have expired since.
    if (now >= certificate.end) return Expired();
    if (table != nullptr) return table->FindCertificate(certificate.names, now);
    return DefaultCaller(absl::StrCat("certificate ", certificate.names.empty() ? "" : certificate.names[0]));
  }

  absl::StatusOr<Caller> ByUser(const AccessTable* table, std::uint32_t uid) const {
    if (table != nullptr) {
      absl::StatusOr<Caller> caller = table->FindUser(uid, rules_.now());
      if (!caller.ok() && ErrorInfoOf(caller.status()).reason == "CREDENTIALS_INVALID") {
        return Missing(absl::StrCat("this server does not know user ", uid, ", who calls without a token"));
      }
      return caller;
    }
    if (uid == rules_.own_uid || uid == kRoot) return DefaultCaller(absl::StrCat("user ", uid));
    return MakeError(absl::StatusCode::kUnauthenticated, "CREDENTIALS_INVALID",
                     absl::StrCat("this socket serves user ", rules_.own_uid, " and root only, not user ", uid));
  }

  const CallerRules rules_;
};

}  // namespace

std::unique_ptr<CallerSource> NewOpenCallerSource() {
  return std::make_unique<OpenCallerSource>();
}

std::unique_ptr<CallerSource> NewCallerSource(CallerRules rules) {
  return std::make_unique<RuledCallerSource>(std::move(rules));
}

}  // namespace planish
