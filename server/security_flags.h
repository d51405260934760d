// The flags of planishd about who may call, and how calls travel.
#pragma once

#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "absl/status/status.h"
#include "server/rpc/listen_address.h"
#include "server/rpc/tls_identity.h"

namespace planish {

struct SecurityFlags {
  std::string access_file;  // empty: who can connect may do everything
  TlsFiles tls;             // no certificate: plaintext
  ClientAuth client_auth = ClientAuth::kNone;
  bool insecure = false;
};

void DefineSecurity(CLI::App* app, SecurityFlags* flags);

// What the flags say together, after they were parsed. INVALID_ARGUMENT, in words, if that makes no sense, or opens one
// of `listen` to other machines without encryption or to anybody, and nobody said --insecure.
absl::Status CheckSecurity(const std::vector<ListenAddress>& listen, SecurityFlags* flags);

}  // namespace planish
