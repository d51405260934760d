#include "tests/testing/certificates.h"

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <atomic>
#include <stdexcept>

#include "absl/time/clock.h"

namespace planish {
namespace {

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(X509_EXTENSION* extension) const { X509_EXTENSION_free(extension); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
template <typename T>
using Owned = std::unique_ptr<T, Free>;

void Check(bool ok, const char* what) {
  if (!ok) throw std::runtime_error(std::string("OpenSSL: ") + what);
}

template <typename Write>
std::string Pem(const Write& write) {
  const Owned<BIO> memory(BIO_new(BIO_s_mem()));
  Check(write(memory.get()) == 1, "writing PEM");
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

std::string Pem(X509* certificate) {
  return Pem([certificate](BIO* out) { return PEM_write_bio_X509(out, certificate); });
}

Owned<EVP_PKEY> NewKey() {
  Owned<EVP_PKEY> key(EVP_EC_gen("P-256"));
  Check(key != nullptr, "making a key");
  return key;
}

void Extend(X509* certificate, X509* issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Owned<X509_EXTENSION> extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  Check(extension != nullptr && X509_add_ext(certificate, extension.get(), -1) == 1, value.c_str());
}

Owned<X509> NewCertificate(const std::string& name, EVP_PKEY* key, absl::Time begin, absl::Time end) {
  static std::atomic<long> serial = 1;
  Owned<X509> certificate(X509_new());
  X509_set_version(certificate.get(), X509_VERSION_3);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), serial++);
  ASN1_TIME_set(X509_getm_notBefore(certificate.get()), absl::ToTimeT(begin));
  ASN1_TIME_set(X509_getm_notAfter(certificate.get()), absl::ToTimeT(end));
  X509_set_pubkey(certificate.get(), key);
  X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate.get()), "CN", MBSTRING_UTF8,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  return certificate;
}

}  // namespace

struct TestAuthority::State {
  Owned<EVP_PKEY> key;
  Owned<X509> certificate;
};

TestAuthority::TestAuthority(const std::string& name) : state_(std::make_unique<State>()) {
  state_->key = NewKey();
  const absl::Time now = absl::Now();
  state_->certificate = NewCertificate(name, state_->key.get(), now - absl::Hours(1), now + absl::Hours(24 * 60));
  X509* mine = state_->certificate.get();
  X509_set_issuer_name(mine, X509_get_subject_name(mine));
  Extend(mine, mine, NID_basic_constraints, "critical,CA:TRUE");
  Extend(mine, mine, NID_key_usage, "critical,keyCertSign,cRLSign");
  Check(X509_sign(mine, state_->key.get(), EVP_sha256()) != 0, "signing");
}

TestAuthority::~TestAuthority() = default;

std::string TestAuthority::certificate() const {
  return Pem(state_->certificate.get());
}

IssuedCertificate TestAuthority::Issue(const CertificateRequest& request) const {
  const Owned<EVP_PKEY> key = NewKey();
  const absl::Time begin =
      request.not_before == absl::InfinitePast() ? absl::Now() - absl::Hours(1) : request.not_before;
  const absl::Time end =
      request.not_after == absl::InfiniteFuture() ? absl::Now() + absl::Hours(24 * 30) : request.not_after;
  const Owned<X509> certificate = NewCertificate(request.common_name, key.get(), begin, end);
  X509_set_issuer_name(certificate.get(), X509_get_subject_name(state_->certificate.get()));
  std::string names;
  for (const std::string& name : request.dns_names) names += (names.empty() ? "DNS:" : ",DNS:") + name;
  for (const std::string& address : request.addresses) names += (names.empty() ? "IP:" : ",IP:") + address;
  if (!names.empty()) Extend(certificate.get(), state_->certificate.get(), NID_subject_alt_name, names);
  Check(X509_sign(certificate.get(), state_->key.get(), EVP_sha256()) != 0, "signing");
  return {Pem(certificate.get()), Pem([&key](BIO* out) {
            return PEM_write_bio_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
          })};
}

IssuedCertificate IssueLocal(const TestAuthority& authority, const std::string& common_name) {
  CertificateRequest request;
  request.common_name = common_name;
  request.dns_names = {"localhost"};
  request.addresses = {"127.0.0.1"};
  return authority.Issue(request);
}

std::string EncryptedKey(const IssuedCertificate& issued) {
  const Owned<BIO> reader(BIO_new_mem_buf(issued.key.data(), static_cast<int>(issued.key.size())));
  const Owned<EVP_PKEY> key(PEM_read_bio_PrivateKey(reader.get(), nullptr, nullptr, nullptr));
  Check(key != nullptr, "reading a key");
  char password[] = "secret";
  return Pem([&](BIO* out) {
    return PEM_write_bio_PKCS8PrivateKey(out, key.get(), EVP_aes_256_cbc(), nullptr, 0, nullptr, password);
  });
}

}  // namespace planish
