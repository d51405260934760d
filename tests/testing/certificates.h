// Certificates for tests, made in memory.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace planish {

struct CertificateRequest {
  std::string common_name;
  std::vector<std::string> dns_names;
  std::vector<std::string> addresses;             // IP
  absl::Time not_before = absl::InfinitePast();   // an hour ago
  absl::Time not_after = absl::InfiniteFuture();  // in thirty days
};

struct IssuedCertificate {
  std::string certificate;  // PEM
  std::string key;          // PEM
};

// Who signs certificates.
class TestAuthority {
 public:
  explicit TestAuthority(const std::string& name = "test authority");
  ~TestAuthority();

  std::string certificate() const;  // PEM
  IssuedCertificate Issue(const CertificateRequest& request) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Of a server at 127.0.0.1 and localhost.
IssuedCertificate IssueLocal(const TestAuthority& authority, const std::string& common_name = "server");

// The same key, encrypted with a password.
std::string EncryptedKey(const IssuedCertificate& issued);

}  // namespace planish
