// A server's certificate and key, which can be replaced while it serves.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "grpcpp/security/server_credentials.h"
#include "server/rpc/tls_files.h"

namespace planish {

// Whether clients are asked for a certificate. kRequest: a client may send one, which must be valid. kRequire: every
// client must.
enum class ClientAuth { kNone, kRequest, kRequire };

// The certificate and key of a server that speaks TLS 1.2 and 1.3. Thread-safe.
class TlsIdentity {
 public:
  // Loads the files. Errors of LoadTlsFiles(). `client_auth` is kNone if and only if there is no client CA.
  static absl::StatusOr<std::shared_ptr<TlsIdentity>> Load(const TlsFiles& files, ClientAuth client_auth,
                                                           absl::Time now);

  // Reads the files again; calling the returned function puts them in force for new connections. Open connections are
  // not affected. Errors of LoadTlsFiles().
  absl::StatusOr<std::function<void()>> Prepare(absl::Time now);

  // Prepare(), and then the returned function. If anything is wrong, nothing changes and the error says what.
  absl::Status Reload(absl::Time now);

  // Credentials for grpc::ServerBuilder. Each new connection asks them for the current files, so they keep this
  // object's data alive.
  std::shared_ptr<grpc::ServerCredentials> credentials() const { return credentials_; }

  const TlsFiles& files() const { return files_; }
  ClientAuth client_auth() const { return client_auth_; }

  // When the certificate in force expires.
  absl::Time not_after() const;

  // The warnings of the last LoadTlsFiles().
  std::vector<std::string> warnings() const;

 private:
  class Current;
  class Credentials;

  TlsIdentity(TlsFiles files, ClientAuth client_auth);

  const TlsFiles files_;
  const ClientAuth client_auth_;
  std::shared_ptr<Current> current_;
  std::shared_ptr<grpc::ServerCredentials> credentials_;
};

}  // namespace planish
