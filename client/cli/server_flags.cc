#include "client/cli/server_flags.h"

#include <cstdlib>

#include "CLI/CLI.hpp"

namespace planish::cli {

void AddServerFlags(CLI::App& app, ServerFlags& flags) {
  app.add_flag("--tls", flags.tls, "Encrypt, and ask the server for a certificate that this system trusts")
      ->envname("PLANISH_TLS");
  app.add_option("--tls-ca", flags.tls_ca_file, "The same, signed by one of these")
      ->envname("PLANISH_TLS_CA")
      ->type_name("PEM");
  app.add_option("--tls-cert", flags.tls_cert_file, "Certificate of your own, for servers that ask for one")
      ->envname("PLANISH_TLS_CERT")
      ->type_name("PEM");
  app.add_option("--tls-key", flags.tls_key_file, "Its key")->envname("PLANISH_TLS_KEY")->type_name("PEM");
  app.add_option("--tls-server-name", flags.tls_server_name, "What the server's certificate is for [the host]")
      ->envname("PLANISH_TLS_SERVER_NAME")
      ->type_name("NAME");
  app.add_option("--token-file", flags.token_file, "Token that says who you are; or the token itself in PLANISH_TOKEN")
      ->envname("PLANISH_TOKEN_FILE")
      ->type_name("FILE");
  app.add_flag("--token-over-plaintext", flags.token_over_plaintext,
               "Send it to another machine even without TLS, for everybody on the way to read");
}

ClientOptions WithServerFlags(ClientOptions options, const ServerFlags& flags) {
  options.tls = flags.tls;
  options.tls_ca_file = flags.tls_ca_file;
  options.tls_cert_file = flags.tls_cert_file;
  options.tls_key_file = flags.tls_key_file;
  options.tls_server_name = flags.tls_server_name;
  options.token_file = flags.token_file;
  options.token_over_plaintext = flags.token_over_plaintext;
  const char* token = std::getenv("PLANISH_TOKEN");
  if (token != nullptr && flags.token_file.empty()) options.token = token;
  return options;
}

}  // namespace planish::cli
