// Identifies the caller of a gRPC call.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "grpcpp/server_context.h"
#include "server/access/access_source.h"
#include "server/access/caller.h"
#include "server/rpc/peer_users.h"

namespace planish {

// Finds the caller of a call by its credentials. Thread-safe.
class CallerSource {
 public:
  virtual ~CallerSource() = default;

  // The caller of this call. UNAUTHENTICATED with CREDENTIALS_MISSING, CREDENTIALS_INVALID or CREDENTIALS_EXPIRED. Must
  // be quick: it runs once for each call.
  virtual absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const = 0;
};

// Every caller is the default tenant, with all rights.
std::unique_ptr<CallerSource> NewOpenCallerSource();

struct CallerRules {
  // `access` and `peers` must outlive the source. access null: there is no access file. peers null: users of Unix
  // sockets are not checked.
  const AccessSource* access = nullptr;
  const PeerUsers* peers = nullptr;
  std::function<absl::Time()> now = absl::Now;
  std::uint32_t own_uid = 0;  // the uid of the server's process
};

// With an access file, the first of these credentials that a call has decides. If it is wrong, the call is refused even
// if it has others too:
//   1. metadata "authorization: Bearer TOKEN"
//   2. the certificate of its TLS connection: a DNS name in it, or the common name of one without DNS names
//   3. the user at the other end of its Unix socket
// Without an access file every caller is the default tenant with all rights, but Unix sockets serve `own_uid` and root
// only. Tokens never appear in messages or logs.
std::unique_ptr<CallerSource> NewCallerSource(CallerRules rules);

}  // namespace planish
