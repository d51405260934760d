#include "server/front_door.h"

#include <unistd.h>

#include <utility>

#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/log/log.h"

namespace planish {
namespace {

// Modes of Unix sockets. With an access file every user of the machine may connect, and the file decides who may call.
// Without an access file the mode keeps other users out, and so does CallerSource.
constexpr unsigned kEverybody = 0666;
constexpr unsigned kOwner = 0600;

// Room for thousands of connections of some kilobytes each, and for one message with two of the largest meshes. The
// limit is not exact: .github/SECURITY.md has measurements.
constexpr std::int64_t kConnectionBytes = std::int64_t{256} << 20;

std::vector<std::string> Named(std::vector<std::string> files) {
  std::erase(files, "");
  return files;
}

void LogWarnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) LogWarn(warning);
}

// Calls the prepared function, or logs the error. `name`: what was prepared, for the log.
void TakeOver(const absl::StatusOr<std::function<void()>>& prepared, const std::string& name) {
  if (prepared.ok()) return (*prepared)();
  LogError(name + " stays as it was", {{"error", std::string(prepared.status().message())}});
}

}  // namespace

FrontDoor::FrontDoor(SecurityFlags flags)
    : flags_(std::move(flags)),
      access_watch_(Named({flags_.access_file})),
      tls_watch_(Named({flags_.tls.certificate, flags_.tls.key, flags_.tls.client_ca})) {}

absl::StatusOr<std::unique_ptr<FrontDoor>> FrontDoor::Open(const SecurityFlags& flags) {
  std::unique_ptr<FrontDoor> door(new FrontDoor(flags));
  if (!flags.access_file.empty()) {
    PLANISH_ASSIGN_OR_RETURN(door->access_, AccessSource::Open(flags.access_file));
    LogWarnings(door->access_->warnings());
  }
  if (!flags.tls.certificate.empty()) {
    PLANISH_ASSIGN_OR_RETURN(door->tls_, TlsIdentity::Load(flags.tls, flags.client_auth, absl::Now()));
    LogWarnings(door->tls_->warnings());
  }
  CallerRules rules;
  rules.access = door->access_.get();
  rules.peers = &door->peers_;
  rules.own_uid = geteuid();
  door->callers_ = NewCallerSource(std::move(rules));
  return door;
}

void FrontDoor::Configure(RpcServerOptions* options) {
  options->tls = tls_;
  options->peers = &peers_;
  options->socket_mode = access_ == nullptr ? kOwner : kEverybody;
  options->quota_bytes = kConnectionBytes + 2 * options->max_mesh_bytes;
  for (const ListenAddress& address : options->listen) {
    if (IsLocal(address)) continue;
    if (tls_ == nullptr) LogWarn(address.text + " serves other machines without encryption");
    if (access_ == nullptr && flags_.client_auth != ClientAuth::kRequire) {
      LogWarn(address.text + " serves everybody who connects: there is no access file");
    }
  }
}

TenantLimitsSource FrontDoor::limits() const {
  return [access = access_.get()](const std::string& tenant) {
    return access == nullptr ? TenantLimits() : access->table()->LimitsOf(tenant);
  };
}

std::function<absl::Time()> FrontDoor::certificate_end() const {
  if (tls_ == nullptr) return nullptr;
  return [tls = tls_] { return tls->not_after(); };
}

absl::StatusOr<std::function<void()>> FrontDoor::PrepareReload() {
  PLANISH_ASSIGN_OR_RETURN(std::function<void()> access, PrepareAccess());
  PLANISH_ASSIGN_OR_RETURN(std::function<void()> tls, PrepareTls());
  return std::function<void()>([access = std::move(access), tls = std::move(tls)] {
    access();
    tls();
  });
}

void FrontDoor::Tick() {
  bool access = false, tls = false;
  {
    const std::lock_guard lock(mutex_);
    access = access_watch_.Changed();
    tls = tls_watch_.Changed();
  }
  if (access) TakeOver(PrepareAccess(), AccessName());
  if (tls) TakeOver(PrepareTls(), TlsName());
}

absl::StatusOr<std::function<void()>> FrontDoor::PrepareAccess() {
  if (access_ == nullptr) return std::function<void()>([] {});
  PLANISH_ASSIGN_OR_RETURN(std::function<void()> put_in_force, access_->Prepare());
  return std::function<void()>([this, put_in_force = std::move(put_in_force)] {
    put_in_force();
    LogInfo(AccessName() + " read again");
    LogWarnings(access_->warnings());
  });
}

absl::StatusOr<std::function<void()>> FrontDoor::PrepareTls() {
  if (tls_ == nullptr) return std::function<void()>([] {});
  PLANISH_ASSIGN_OR_RETURN(std::function<void()> put_in_force, tls_->Prepare(absl::Now()));
  return std::function<void()>([this, put_in_force = std::move(put_in_force)] {
    put_in_force();
    LogInfo(TlsName() + " read again");
    LogWarnings(tls_->warnings());
  });
}

std::string FrontDoor::AccessName() const {
  return "the access file " + flags_.access_file;
}

std::string FrontDoor::TlsName() const {
  return "the certificate " + flags_.tls.certificate;
}

}  // namespace planish
