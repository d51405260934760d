#include "server/metrics/certificate.h"

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <cstdio>

#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

// A certificate that signs itself and ends at `end`.
void WriteCertificate(const std::string& path, std::time_t end) {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  X509* certificate = X509_new();
  ASN1_TIME_set(X509_getm_notBefore(certificate), end - 1000);
  ASN1_TIME_set(X509_getm_notAfter(certificate), end);
  X509_set_pubkey(certificate, key);
  ASSERT_GT(X509_sign(certificate, key, EVP_sha256()), 0);
  std::FILE* file = std::fopen(path.c_str(), "w");
  PEM_write_X509(file, certificate);
  std::fclose(file);
  X509_free(certificate);
  EVP_PKEY_free(key);
}

TEST(CertificateEnd, IsInTheFile) {
  TempDir dir;
  WriteCertificate(dir.Path("a.pem"), 1'900'000'000);
  EXPECT_EQ(CertificateFileEnd(dir.Path("a.pem")), absl::FromUnixSeconds(1'900'000'000));
  WriteCertificate(dir.Path("b.pem"), 2'600'000'000);  // another form of time, after 2049
  EXPECT_EQ(CertificateFileEnd(dir.Path("b.pem")), absl::FromUnixSeconds(2'600'000'000));
}

TEST(CertificateEnd, IsTheEpochWithoutOne) {
  TempDir dir;
  EXPECT_EQ(CertificateFileEnd(dir.Path("none")), absl::UnixEpoch());
  PutFile(dir.Path("text"), "no certificate");
  EXPECT_EQ(CertificateFileEnd(dir.Path("text")), absl::UnixEpoch());
}

}  // namespace
}  // namespace planish
