// Reads and checks the files of TLS.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace planish {

// Paths of PEM files.
struct TlsFiles {
  std::string certificate;  // the server's certificate, then the intermediate ones
  std::string key;          // of the certificate, not encrypted
  std::string client_ca;    // CA of client certificates; empty: clients are not asked for one
};

struct TlsMaterial {
  std::string certificate;
  std::string key;
  std::string client_ca;
  absl::Time not_after;               // when the server's certificate expires
  std::vector<std::string> warnings;  // e.g. that everybody may read the key
};

// Reads and checks the files. INVALID_ARGUMENT with a message that names the file if one cannot be read or has no PEM,
// or the certificate does not belong to the key or is not valid at `now`.
absl::StatusOr<TlsMaterial> LoadTlsFiles(const TlsFiles& files, absl::Time now);

// When the first certificate in `pem` expires; InfinitePast if there is none.
absl::Time CertificateEnd(const std::string& pem);

}  // namespace planish
