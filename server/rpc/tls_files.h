// The files of TLS: read, and checked before anybody trusts them.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace planish {

// Paths of PEM files.
struct TlsFiles {
  std::string certificate;  // the server's own, then those between it and the root
  std::string key;          // of the certificate, not encrypted
  std::string client_ca;    // who signs certificates of clients; empty: clients are not asked for any
};

struct TlsMaterial {
  std::string certificate;
  std::string key;
  std::string client_ca;
  absl::Time not_after;               // when the server's certificate ends
  std::vector<std::string> warnings;  // e.g. that everybody may read the key
};

// INVALID_ARGUMENT with a message that names the file if one cannot be read or has no PEM, or the certificate does not
// belong to the key or is not valid at `now`.
absl::StatusOr<TlsMaterial> LoadTlsFiles(const TlsFiles& files, absl::Time now);

// When the first certificate in `pem` ends; InfinitePast if there is none.
absl::Time CertificateEnd(const std::string& pem);

}  // namespace planish
