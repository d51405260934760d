// Reads certificates and keys from PEM files.
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

// All certificates in `pem`, in order; may be empty.
std::vector<CertificatePtr> CertificatesIn(const std::string& pem);

// The first private key in `pem`; null if there is none or it is encrypted. Unless `is_encrypted` is null, stores
// there whether the key is encrypted. Never prompts for a password.
KeyPtr KeyIn(const std::string& pem, bool* is_encrypted = nullptr);

}  // namespace planish
