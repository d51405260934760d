// Who gets in, and how: TLS, the access file and users of Unix sockets, by the flags of planishd.
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

  // When the certificate in force ends; null without TLS. Must not outlive this object.
  std::function<absl::Time()> certificate_end() const;

  // Null without an access file.
  const AccessSource* access() const { return access_.get(); }

  // Reads all files again; the function puts what they say in force, and says so in the log. The first error if
  // anything is wrong with any of them.
  absl::StatusOr<std::function<void()>> PrepareReload();

  // Takes over what has changed, each file on its own: what is wrong stays as it was. Logs what came of it. Call it a
  // few times a second.
  void Tick();

 private:
  explicit FrontDoor(SecurityFlags flags);
  // A function that does nothing without these files.
  absl::StatusOr<std::function<void()>> PrepareAccess();
  absl::StatusOr<std::function<void()>> PrepareTls();
  // In the log.
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
