// Who makes a call over gRPC.
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

// Thread-safe.
class CallerSource {
 public:
  virtual ~CallerSource() = default;

  // UNAUTHENTICATED with CREDENTIALS_MISSING, CREDENTIALS_INVALID or CREDENTIALS_EXPIRED. Quick: it runs once a call.
  virtual absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const = 0;
};

// Takes everybody for the default tenant, with all rights.
std::unique_ptr<CallerSource> NewOpenCallerSource();

struct CallerRules {
  // Both must outlive the source. Null: there is no access file; nobody asks who is at a Unix socket.
  const AccessSource* access = nullptr;
  const PeerUsers* peers = nullptr;
  std::function<absl::Time()> now = absl::Now;
  std::uint32_t own_uid = 0;  // of the server
};

// With an access file the first of these that a call has says who calls, and if that is wrong the others do not help:
//   1. metadata "authorization: Bearer TOKEN"
//   2. the certificate of its TLS connection: a DNS name in it, or the common name of one without DNS names
//   3. the user at the other end of its Unix socket
// Without one everybody is the default tenant with all rights, but Unix sockets serve `own_uid` and root only. Tokens
// appear in no message and no log.
std::unique_ptr<CallerSource> NewCallerSource(CallerRules rules);

}  // namespace planish
