#include "core/base/pem.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

namespace planish {
namespace {

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;

Bio Reader(const std::string& pem) {
  return {BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())), &BIO_free};
}

// Called when a key is encrypted. Never prompts for a password.
int NoPassword(char*, int, int, void* asked) {
  *static_cast<bool*>(asked) = true;
  return 0;
}

}  // namespace

void FreePem::operator()(X509* certificate) const {
  X509_free(certificate);
}

void FreePem::operator()(EVP_PKEY* key) const {
  EVP_PKEY_free(key);
}

std::vector<CertificatePtr> CertificatesIn(const std::string& pem) {
  std::vector<CertificatePtr> certificates;
  const Bio reader = Reader(pem);
  while (X509* next = PEM_read_bio_X509(reader.get(), nullptr, nullptr, nullptr)) certificates.emplace_back(next);
  ERR_clear_error();  // removes the error "no start line" that ends the loop
  return certificates;
}

KeyPtr KeyIn(const std::string& pem, bool* is_encrypted) {
  const Bio reader = Reader(pem);
  bool asked = false;
  KeyPtr key(PEM_read_bio_PrivateKey(reader.get(), nullptr, NoPassword, &asked));
  ERR_clear_error();
  if (is_encrypted != nullptr) *is_encrypted = asked;
  return key;
}

}  // namespace planish
