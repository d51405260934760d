#include "server/rpc/tls_identity.h"

#include <utility>

#include "core/base/status_macros.h"
#include "grpc/grpc.h"
#include "grpc/grpc_security.h"

namespace planish {

// The contents of the files when they were last valid, with a number that increases with each change.
class TlsIdentity::Current {
 public:
  void Set(TlsMaterial material) {
    const std::lock_guard lock(mutex_);
    const bool is_same = number_ > 0 && material.certificate == material_.certificate &&
                         material.key == material_.key && material.client_ca == material_.client_ca;
    material_ = std::move(material);
    if (!is_same) ++number_;
  }

  absl::Time not_after() const {
    const std::lock_guard lock(mutex_);
    return material_.not_after;
  }

  std::vector<std::string> warnings() const {
    const std::lock_guard lock(mutex_);
    return material_.warnings;
  }

  // A configuration for gRPC, or null if the caller already has the one with this number.
  grpc_ssl_server_certificate_config* NewerThan(int* number) const {
    const std::lock_guard lock(mutex_);
    if (*number == number_) return nullptr;
    *number = number_;
    const grpc_ssl_pem_key_cert_pair pair = {material_.key.c_str(), material_.certificate.c_str()};
    // gRPC 1.51 aborts without root certificates, even if it never uses them.
    const std::string& roots = material_.client_ca.empty() ? material_.certificate : material_.client_ca;
    return grpc_ssl_server_certificate_config_create(roots.c_str(), &pair, 1);
  }

 private:
  mutable std::mutex mutex_;
  TlsMaterial material_;
  int number_ = 0;
};

namespace {

grpc_ssl_client_certificate_request_type RequestType(ClientAuth client_auth) {
  switch (client_auth) {
    case ClientAuth::kNone:
      return GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE;
    case ClientAuth::kRequest:
      return GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY;
    case ClientAuth::kRequire:
      return GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY;
  }
  return GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY;
}

}  // namespace

// We do not use grpc::experimental::FileWatcherCertificateProvider, since it does not check the files: a certificate
// that does not match its key would fail all handshakes. gRPC's C interface asks for a configuration at each handshake
// instead, and gets the checked files.
class TlsIdentity::Credentials : public grpc::ServerCredentials {
 public:
  Credentials(std::shared_ptr<const Current> current, ClientAuth client_auth)
      : current_(std::move(current)), client_auth_(client_auth) {}

  // Not needed: CallerSource checks each call.
  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {}

 private:
  // The configuration that a listener has: gRPC remembers it by listener.
  struct Listener {
    std::shared_ptr<const Current> current;
    std::mutex mutex;
    int number = 0;  // guarded by mutex
  };

  static grpc_ssl_certificate_config_reload_status Fetch(void* listener, grpc_ssl_server_certificate_config** config) {
    auto* mine = static_cast<Listener*>(listener);
    const std::lock_guard lock(mine->mutex);
    *config = mine->current->NewerThan(&mine->number);
    return *config == nullptr ? GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED : GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  int AddPortToServer(const std::string& address, grpc_server* server) override {
    listeners_.push_back(std::make_unique<Listener>());
    listeners_.back()->current = current_;
    // The credentials take ownership of the options.
    grpc_server_credentials* credentials =
        grpc_ssl_server_credentials_create_with_options(grpc_ssl_server_credentials_create_options_using_config_fetcher(
            RequestType(client_auth_), &Credentials::Fetch, listeners_.back().get()));
    const int port = grpc_server_add_http2_port(server, address.c_str(), credentials);
    grpc_server_credentials_release(credentials);
    return port;
  }

  const std::shared_ptr<const Current> current_;
  const ClientAuth client_auth_;
  std::vector<std::unique_ptr<Listener>> listeners_;
};

TlsIdentity::TlsIdentity(TlsFiles files, ClientAuth client_auth)
    : files_(std::move(files)), client_auth_(client_auth), current_(std::make_shared<Current>()) {
  credentials_ = std::make_shared<Credentials>(current_, client_auth_);
}

absl::StatusOr<std::shared_ptr<TlsIdentity>> TlsIdentity::Load(const TlsFiles& files, ClientAuth client_auth,
                                                               absl::Time now) {
  std::shared_ptr<TlsIdentity> identity(new TlsIdentity(files, client_auth));
  PLANISH_RETURN_IF_ERROR(identity->Reload(now));
  return identity;
}

absl::StatusOr<std::function<void()>> TlsIdentity::Prepare(absl::Time now) {
  PLANISH_ASSIGN_OR_RETURN(TlsMaterial material, LoadTlsFiles(files_, now));
  return std::function<void()>([current = current_, material = std::move(material)] { current->Set(material); });
}

absl::Status TlsIdentity::Reload(absl::Time now) {
  PLANISH_ASSIGN_OR_RETURN(const std::function<void()> put_in_force, Prepare(now));
  put_in_force();
  return absl::OkStatus();
}

absl::Time TlsIdentity::not_after() const {
  return current_->not_after();
}

std::vector<std::string> TlsIdentity::warnings() const {
  return current_->warnings();
}

}  // namespace planish
