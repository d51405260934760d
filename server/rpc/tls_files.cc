#include "server/rpc/tls_files.h"

#include <openssl/err.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <ctime>

#include "absl/strings/str_cat.h"
#include "core/base/pem.h"
#include "core/base/read_file.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// A certificate that expires sooner than this causes a warning.
constexpr absl::Duration kSoon = absl::Hours(14 * 24);

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

}  // namespace

absl::StatusOr<TlsMaterial> LoadTlsFiles(const TlsFiles& files, absl::Time now) {
  TlsMaterial material;
  PLANISH_ASSIGN_OR_RETURN(material.certificate, ReadTextFile("the certificate", files.certificate));
  PLANISH_ASSIGN_OR_RETURN(material.key, ReadTextFile("the key", files.key));
  const std::vector<CertificatePtr> chain = CertificatesIn(material.certificate);
  if (chain.empty()) return absl::InvalidArgumentError(files.certificate + ": no certificate in PEM");
  bool is_encrypted = false;
  const KeyPtr key = KeyIn(material.key, &is_encrypted);
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        files.key +
        (is_encrypted ? ": the key is encrypted; a server needs a key without a password" : ": no private key in PEM"));
  }
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
    material.warnings.push_back(files.key + ": everybody on this machine can read or change it: chmod o-rw " +
                                files.key);
  }
  if (files.client_ca.empty()) return material;

  PLANISH_ASSIGN_OR_RETURN(material.client_ca, ReadTextFile("the clients' CA", files.client_ca));
  const std::vector<CertificatePtr> roots = CertificatesIn(material.client_ca);
  if (roots.empty()) return absl::InvalidArgumentError(files.client_ca + ": no certificate in PEM");
  for (const CertificatePtr& root : roots) {
    const absl::Status dates = CheckDates(files.client_ca, *root, now);
    if (dates.ok()) continue;
    if (roots.size() == 1) return dates;
    material.warnings.emplace_back(dates.message());
  }
  return material;
}

absl::Time CertificateEnd(const std::string& pem) {
  const std::vector<CertificatePtr> certificates = CertificatesIn(pem);
  return certificates.empty() ? absl::InfinitePast() : TimeOf(X509_get0_notAfter(certificates[0].get()));
}

}  // namespace planish
