// How to reach a server, and who calls: the flags of every command that talks to one.
#pragma once

#include <string>

#include "CLI/App.hpp"
#include "planish/client.h"

namespace planish::cli {

// Of ClientOptions, under the names that they have there.
struct ServerFlags {
  bool tls = false;
  std::string tls_ca_file, tls_cert_file, tls_key_file, tls_server_name;
  std::string token_file;
  bool token_over_plaintext = false;
};

// --tls, --tls-ca, --tls-cert, --tls-key, --tls-server-name, --token-file and --token-over-plaintext, with PLANISH_TLS,
// PLANISH_TLS_CA, ... in the environment.
void AddServerFlags(CLI::App& app, ServerFlags& flags);

// `options` with what the flags say, and with the token in PLANISH_TOKEN if they name no file. A token has no flag:
// everybody on the machine sees the arguments of a command.
ClientOptions WithServerFlags(ClientOptions options, const ServerFlags& flags);

}  // namespace planish::cli
