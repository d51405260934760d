// Who gets in, and how: TLS, the access file and users of Unix sockets, by the flags of planishd.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/access_source.h"
#include "server/access/tenant.h"
#include "server/file_watch.h"
#include "server/rpc/caller_source.h"
#include "server/rpc/peer_users.h"
#include "server/rpc/rpc_server.h"
#include "server/security_flags.h"

namespace planish {

// Must outlive the RpcServer that it has opened for. Thread-safe.
class FrontDoor {
 public:
  // Reads and checks all files; INVALID_ARGUMENT with what is wrong with them.
  static absl::StatusOr<std::unique_ptr<FrontDoor>> Open(const SecurityFlags& flags);

  // Sets what of `options` is about security.
  void Configure(RpcServerOptions* options);

  const CallerSource& callers() const { return *callers_; }

  // By the access file as it is at each call; defaults without one. Must not outlive this object.
  TenantLimitsSource limits() const;

  // Null without an access file.
  const AccessSource* access() const { return access_.get(); }

  // Reads all files again, and logs what came of it. What is wrong stays as it was; the first error is returned.
  absl::Status Reload();

  // The same for what has changed. Call it a few times a second.
  void Tick();

 private:
  explicit FrontDoor(SecurityFlags flags);
  absl::Status ReloadAccess();
  absl::Status ReloadTls();
  void LogWarnings() const;

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
