// A server's certificate and key, which may change while it serves.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "grpcpp/security/server_credentials.h"
#include "server/rpc/tls_files.h"

namespace planish {

// What clients are asked for. kRequest: those that send a certificate must have a valid one. kRequire: all of them.
enum class ClientAuth { kNone, kRequest, kRequire };

// Thread-safe. TLS 1.2 and 1.3.
class TlsIdentity {
 public:
  // Errors of LoadTlsFiles(). `client_auth` is kNone if and only if there is no client CA.
  static absl::StatusOr<std::shared_ptr<TlsIdentity>> Load(const TlsFiles& files, ClientAuth client_auth,
                                                           absl::Time now);

  // Reads the files again; the function puts them in force for new connections, open ones go on. Errors of
  // LoadTlsFiles().
  absl::StatusOr<std::function<void()>> Prepare(absl::Time now);

  // Both at once. If anything is wrong all stays as it was and the error says what.
  absl::Status Reload(absl::Time now);

  // For grpc::ServerBuilder. Connections ask for the files' content as they come, so this object lives on with it.
  std::shared_ptr<grpc::ServerCredentials> credentials() const { return credentials_; }

  const TlsFiles& files() const { return files_; }
  ClientAuth client_auth() const { return client_auth_; }

  // When the certificate in force ends.
  absl::Time not_after() const;

  // Of LoadTlsFiles(), last time.
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
