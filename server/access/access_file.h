// The access file of a server: YAML with tenants, their limits and their credentials.
//
//   tenants:
//     lighting:                     # [a-z0-9][a-z0-9_-]{0,62}
//       share: 2                    # to store-mb: TenantLimits, all optional; share: > 0, up to 1e6
//       queue: 200                  # 0 to 100000
//       running: 4                  # 1 to 1024
//       memory-mb: 8192             # 1 to 1e8, MiB
//       store-mb: 2048              # 1 to 1e8, MiB
//       credentials:
//         - token-sha256: "..."     # 64 hexadecimal digits: SHA-256 of the token, never the token itself
//           name: farm              # for logs; otherwise the digest's first 8 digits
//           rights: [submit, jobs]  # any of submit, jobs, all-jobs, admin; without this line: submit and jobs
//           expires: 2027-01-01T00:00:00Z     # optional, RFC 3339
//         - certificate: render-7.studio      # DNS name of a client certificate (common name if it has none)
//         - user: 1000              # the user who calls through a Unix socket: a uid, or a user's name
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/access/access_table.h"

namespace planish {

// Parses the text of an access file. INVALID_ARGUMENT with "FILE:LINE: KEY: what is wrong", where FILE is `file`.
absl::StatusOr<std::shared_ptr<const AccessTable>> ParseAccessFile(const std::string& text, const std::string& file);

struct LoadedAccess {
  std::shared_ptr<const AccessTable> table;
  std::vector<std::string> warnings;  // e.g. that everybody may read the file
};

// Reads and parses a file. INVALID_ARGUMENT also if it cannot be read, or if everybody may write to it.
absl::StatusOr<LoadedAccess> LoadAccessFile(const std::string& file);

}  // namespace planish
