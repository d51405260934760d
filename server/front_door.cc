#include "server/front_door.h"

#include <unistd.h>

#include <utility>

#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/log/log.h"

namespace planish {
namespace {

// An access file knows who of the machine's users may call: all of them may knock. Without one the kernel keeps others
// out, and CallerSource once more.
constexpr unsigned kEverybody = 0666;
constexpr unsigned kOwner = 0600;

// Room for thousands of connections, which have some kilobytes each, and beside them two of the largest meshes in one
// message. It is soft: .github/SECURITY.md has what was measured.
constexpr std::int64_t kConnectionBytes = std::int64_t{256} << 20;

std::vector<std::string> Named(std::vector<std::string> files) {
  std::erase(files, "");
  return files;
}

absl::Status Told(const absl::Status& status, const std::string& what) {
  if (status.ok()) {
    LogInfo(what + " read again");
  } else {
    LogError(what + " stays as it was", {{"error", std::string(status.message())}});
  }
  return status;
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
  }
  if (!flags.tls.certificate.empty()) {
    PLANISH_ASSIGN_OR_RETURN(door->tls_, TlsIdentity::Load(flags.tls, flags.client_auth, absl::Now()));
  }
  CallerRules rules;
  rules.access = door->access_.get();
  rules.peers = &door->peers_;
  rules.own_uid = geteuid();
  door->callers_ = NewCallerSource(std::move(rules));
  door->LogWarnings();
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
      LogWarn(address.text + " serves whoever connects: there is no access file");
    }
  }
}

TenantLimitsSource FrontDoor::limits() const {
  return [access = access_.get()](const std::string& tenant) {
    return access == nullptr ? TenantLimits() : access->table()->LimitsOf(tenant);
  };
}

absl::Status FrontDoor::Reload() {
  const absl::Status access = ReloadAccess();
  const absl::Status tls = ReloadTls();
  return access.ok() ? tls : access;
}

void FrontDoor::Tick() {
  bool access = false, tls = false;
  {
    const std::lock_guard lock(mutex_);
    access = access_watch_.Changed();
    tls = tls_watch_.Changed();
  }
  // Logged; nobody else waits for the answer.
  if (access) static_cast<void>(ReloadAccess());
  if (tls) static_cast<void>(ReloadTls());
}

absl::Status FrontDoor::ReloadAccess() {
  if (access_ == nullptr) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(Told(access_->Reload(), "the access file " + flags_.access_file));
  for (const std::string& warning : access_->warnings()) LogWarn(warning);
  return absl::OkStatus();
}

absl::Status FrontDoor::ReloadTls() {
  if (tls_ == nullptr) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(Told(tls_->Reload(absl::Now()), "the certificate " + flags_.tls.certificate));
  for (const std::string& warning : tls_->warnings()) LogWarn(warning);
  return absl::OkStatus();
}

void FrontDoor::LogWarnings() const {
  if (access_ != nullptr) {
    for (const std::string& warning : access_->warnings()) LogWarn(warning);
  }
  if (tls_ != nullptr) {
    for (const std::string& warning : tls_->warnings()) LogWarn(warning);
  }
}

}  // namespace planish
