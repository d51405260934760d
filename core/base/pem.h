// What PEM files hold.
#pragma once

#include <openssl/types.h>

#include <memory>
#include <string>
#include <vector>

namespace planish {

struct FreePem {
  void operator()(X509* certificate) const;
  void operator()(EVP_PKEY* key) const;
};
using CertificatePtr = std::unique_ptr<X509, FreePem>;
using KeyPtr = std::unique_ptr<EVP_PKEY, FreePem>;

// All certificates, in order; empty if there is none.
std::vector<CertificatePtr> CertificatesIn(const std::string& pem);

// The first private key; null if there is none, or if it is encrypted, which `is_encrypted` tells unless it is null:
// nobody is asked for a password.
KeyPtr KeyIn(const std::string& pem, bool* is_encrypted = nullptr);

}  // namespace planish
