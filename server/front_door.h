// Access control by the flags of planishd: TLS, the access file, and the users of Unix sockets.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/access/access_source.h"
#include "server/access/tenant.h"
#include "server/file_watch.h"
#include "server/rpc/caller_source.h"
#include "server/rpc/peer_users.h"
#include "server/rpc/rpc_server.h"
#include "server/security_flags.h"

namespace planish {

// Reads the files that the flags name, and reloads them when they change. Must outlive the RpcServer that it
// configured. Thread-safe.
class FrontDoor {
 public:
  // Reads and checks all files. INVALID_ARGUMENT says what is wrong with them.
  static absl::StatusOr<std::unique_ptr<FrontDoor>> Open(const SecurityFlags& flags);

  // Sets the security options among `options`.
  void Configure(RpcServerOptions* options);

  const CallerSource& callers() const { return *callers_; }

  // Looks limits up in the access file that is in force at the time; defaults without a file. Must not outlive this
  // object.
  TenantLimitsSource limits() const;

  // When the certificate in force expires; null without TLS. Must not outlive this object.
  std::function<absl::Time()> certificate_end() const;

  // The access file; null if there is none.
  const AccessSource* access() const { return access_.get(); }

  // Reads all files again; calling the returned function puts them in force and logs it. If any file is wrong, returns
  // the first error.
  absl::StatusOr<std::function<void()>> PrepareReload();

  // Reloads files that changed, each independently of the others. A wrong file changes nothing. Logs the outcome. Call
  // it a few times a second.
  void Tick();

 private:
  explicit FrontDoor(SecurityFlags flags);
  // Prepare the reload of the access file, or of the TLS files. If there are none, the returned function does nothing.
  absl::StatusOr<std::function<void()>> PrepareAccess();
  absl::StatusOr<std::function<void()>> PrepareTls();
  // Names for the log.
  std::string AccessName() const;
  std::string TlsName() const;

  const SecurityFlags flags_;
  PeerUsers peers_;
  std::unique_ptr<AccessSource> access_;
  std::shared_ptr<TlsIdentity> tls_;
  std::unique_ptr<CallerSource> callers_;

  std::mutex mutex_;
  FileWatch access_watch_;  // guarded by mutex_
  FileWatch tls_watch_;     // guarded by mutex_
};

}  // namespace planish
