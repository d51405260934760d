#include "server/rpc/tls_files.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <cerrno>
#include <ctime>
#include <fstream>
#include <memory>
#include <sstream>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// A certificate that ends sooner than this is worth a warning.
constexpr absl::Duration kSoon = absl::Hours(14 * 24);

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
using Bio = std::unique_ptr<BIO, Free>;
using X509Pointer = std::unique_ptr<X509, Free>;
using Key = std::unique_ptr<EVP_PKEY, Free>;

Bio Reader(const std::string& pem) {
  return Bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
}

// Never asks anybody for a password.
int NoPassword(char*, int, int, void* asked) {
  *static_cast<bool*>(asked) = true;
  return 0;
}

absl::StatusOr<std::string> ReadText(const std::string& what, const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) {
    const int error = errno;
    return absl::InvalidArgumentError(
        absl::StrCat("cannot read ", what, " ", path, ": ", std::generic_category().message(error)));
  }
  return text.str();
}

std::vector<X509Pointer> CertificatesIn(const std::string& pem) {
  std::vector<X509Pointer> certificates;
  const Bio reader = Reader(pem);
  while (X509* next = PEM_read_bio_X509(reader.get(), nullptr, nullptr, nullptr)) certificates.emplace_back(next);
  ERR_clear_error();  // "no start line" after the last one
  return certificates;
}

absl::Time TimeOf(const ASN1_TIME* time) {
  std::tm parts = {};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return absl::InfinitePast();
  return absl::FromTM(parts, absl::UTCTimeZone());
}

std::string Text(absl::Time time) {
  return absl::FormatTime(absl::RFC3339_sec, time, absl::UTCTimeZone());
}

absl::Status CheckDates(const std::string& path, const X509& certificate, absl::Time now) {
  const absl::Time begin = TimeOf(X509_get0_notBefore(&certificate));
  const absl::Time end = TimeOf(X509_get0_notAfter(&certificate));
  if (now >= end) return absl::InvalidArgumentError(absl::StrCat(path, ": the certificate expired at ", Text(end)));
  if (now < begin) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": the certificate is valid from ", Text(begin), " only"));
  }
  return absl::OkStatus();
}

absl::StatusOr<Key> KeyIn(const std::string& pem, const std::string& path) {
  const Bio reader = Reader(pem);
  bool asked = false;
  Key key(PEM_read_bio_PrivateKey(reader.get(), nullptr, NoPassword, &asked));
  ERR_clear_error();
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        path + (asked ? ": the key is encrypted, which a server without anybody to type a password cannot use"
                      : ": no private key in PEM"));
  }
  return key;
}

}  // namespace

absl::StatusOr<TlsMaterial> LoadTlsFiles(const TlsFiles& files, absl::Time now) {
  TlsMaterial material;
  PLANISH_ASSIGN_OR_RETURN(material.certificate, ReadText("the certificate", files.certificate));
  PLANISH_ASSIGN_OR_RETURN(material.key, ReadText("the key", files.key));
  const std::vector<X509Pointer> chain = CertificatesIn(material.certificate);
  if (chain.empty()) return absl::InvalidArgumentError(files.certificate + ": no certificate in PEM");
  PLANISH_ASSIGN_OR_RETURN(const Key key, KeyIn(material.key, files.key));
  if (X509_check_private_key(chain[0].get(), key.get()) != 1) {
    ERR_clear_error();
    return absl::InvalidArgumentError(
        absl::StrCat("the certificate in ", files.certificate, " does not belong to the key in ", files.key));
  }
  PLANISH_RETURN_IF_ERROR(CheckDates(files.certificate, *chain[0], now));
  material.not_after = TimeOf(X509_get0_notAfter(chain[0].get()));
  if (material.not_after - now < kSoon) {
    material.warnings.push_back(
        absl::StrCat(files.certificate, ": the certificate expires at ", Text(material.not_after)));
  }
  struct stat info = {};
  if (stat(files.key.c_str(), &info) == 0 && (info.st_mode & (S_IROTH | S_IWOTH)) != 0) {
    material.warnings.push_back(files.key + ": everybody on this machine may read or change it: chmod o-rw " +
                                files.key);
  }
  if (files.client_ca.empty()) return material;

  PLANISH_ASSIGN_OR_RETURN(material.client_ca, ReadText("the clients' CA", files.client_ca));
  const std::vector<X509Pointer> roots = CertificatesIn(material.client_ca);
  if (roots.empty()) return absl::InvalidArgumentError(files.client_ca + ": no certificate in PEM");
  for (const X509Pointer& root : roots) {
    const absl::Status dates = CheckDates(files.client_ca, *root, now);
    if (dates.ok()) continue;
    if (roots.size() == 1) return dates;
    material.warnings.emplace_back(dates.message());
  }
  return material;
}

absl::Time CertificateEnd(const std::string& pem) {
  const std::vector<X509Pointer> certificates = CertificatesIn(pem);
  return certificates.empty() ? absl::InfinitePast() : TimeOf(X509_get0_notAfter(certificates[0].get()));
}

}  // namespace planish
