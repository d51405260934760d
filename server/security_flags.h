// The flags of planishd about credentials and encryption.
#pragma once

#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "absl/status/status.h"
#include "server/rpc/listen_address.h"
#include "server/rpc/tls_identity.h"

namespace planish {

struct SecurityFlags {
  std::string access_file;  // empty: everybody who can connect has all rights
  TlsFiles tls;             // no certificate: plaintext
  ClientAuth client_auth = ClientAuth::kNone;
  bool insecure = false;
};

void DefineSecurity(CLI::App* app, SecurityFlags* flags);

// Checks the combination of flags after parsing. INVALID_ARGUMENT, with a message for people, if they contradict each
// other, or if, without --insecure, an address in `listen` would serve other machines without encryption or without
// credentials.
absl::Status CheckSecurity(const std::vector<ListenAddress>& listen, SecurityFlags* flags);

}  // namespace planish
