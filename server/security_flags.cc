#include "server/security_flags.h"

#include "CLI/CLI.hpp"
#include "server/config/choice.h"

namespace planish {
namespace {

// An address in `listen` that other machines can reach; empty if there is none.
std::string OpenAddress(const std::vector<ListenAddress>& listen) {
  for (const ListenAddress& address : listen) {
    if (!IsLocal(address)) return address.text;
  }
  return "";
}

}  // namespace

void DefineSecurity(CLI::App* app, SecurityFlags* flags) {
  app->add_option("--access-file", flags->access_file,
                  "YAML with tenants, their tokens, certificates, users, rights and limits; read again when it "
                  "changes. Without it everybody who can connect has all rights")
      ->type_name("FILE");
  app->add_option("--tls-cert", flags->tls.certificate,
                  "Certificate of this server and the intermediate ones, PEM; switches TLS on for all TCP addresses. "
                  "This file and the next two are read again when they change")
      ->type_name("FILE");
  app->add_option("--tls-key", flags->tls.key, "Key of the certificate, PEM, not encrypted")->type_name("FILE");
  app->add_option("--tls-client-ca", flags->tls.client_ca, "CA of client certificates, PEM")->type_name("FILE");
  AddChoice<ClientAuth>(
      app, "--tls-client-auth", &flags->client_auth,
      {{"auto", ClientAuth::kNone}, {"require", ClientAuth::kRequire}, {"request", ClientAuth::kRequest}},
      "Whether clients must or may have a certificate; auto: they must if --tls-client-ca is given");
  app->add_flag("--insecure", flags->insecure,
                "Serve other machines even without TLS or credentials, on a trusted network");
}

absl::Status CheckSecurity(const std::vector<ListenAddress>& listen, SecurityFlags* flags) {
  const TlsFiles& tls = flags->tls;
  if (!tls.certificate.empty() && tls.key.empty()) return absl::InvalidArgumentError("--tls-cert needs --tls-key");
  if (!tls.key.empty() && tls.certificate.empty()) return absl::InvalidArgumentError("--tls-key needs --tls-cert");
  if (!tls.client_ca.empty() && tls.certificate.empty()) {
    return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key: client certificates need TLS");
  }
  if (flags->client_auth != ClientAuth::kNone && tls.client_ca.empty()) {
    return absl::InvalidArgumentError("--tls-client-auth needs --tls-client-ca, the CA of client certificates");
  }
  if (flags->client_auth == ClientAuth::kNone && !tls.client_ca.empty()) flags->client_auth = ClientAuth::kRequire;

  const std::string open = OpenAddress(listen);
  if (open.empty() || flags->insecure) return absl::OkStatus();
  if (tls.certificate.empty()) {
    return absl::InvalidArgumentError("other machines reach " + open +
                                      " without encryption: give --tls-cert and --tls-key (deploy/certificates.sh "
                                      "makes some to try), or --insecure on a trusted network, or listen on 127.0.0.1");
  }
  if (flags->access_file.empty() && flags->client_auth != ClientAuth::kRequire) {
    return absl::InvalidArgumentError(
        "other machines reach " + open +
        " without credentials, with all rights: give --access-file with tokens, or --tls-client-ca for client "
        "certificates, or --insecure on a trusted network, or listen on 127.0.0.1");
  }
  return absl::OkStatus();
}

}  // namespace planish
