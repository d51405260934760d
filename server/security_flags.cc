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
                  "changes. Without it who can connect may do everything")
      ->type_name("FILE");
  app->add_option("--tls-cert", flags->tls.certificate,
                  "Certificate of this server, with those between it and the root, PEM: TLS on all TCP addresses. This "
                  "and the next two are read again when they change")
      ->type_name("FILE");
  app->add_option("--tls-key", flags->tls.key, "Its key, PEM, without a password")->type_name("FILE");
  app->add_option("--tls-client-ca", flags->tls.client_ca, "Who signs certificates of clients, PEM")->type_name("FILE");
  AddChoice<ClientAuth>(
      app, "--tls-client-auth", &flags->client_auth,
      {{"auto", ClientAuth::kNone}, {"require", ClientAuth::kRequire}, {"request", ClientAuth::kRequest}},
      "Whether clients must have a certificate, or may have one; auto: they must if there is --tls-client-ca");
  app->add_flag("--insecure", flags->insecure,
                "Serve other machines even without TLS, or without asking who calls: on a network that is trusted");
}

absl::Status CheckSecurity(const std::vector<ListenAddress>& listen, SecurityFlags* flags) {
  const TlsFiles& tls = flags->tls;
  if (!tls.certificate.empty() && tls.key.empty()) return absl::InvalidArgumentError("--tls-cert needs --tls-key");
  if (!tls.key.empty() && tls.certificate.empty()) return absl::InvalidArgumentError("--tls-key needs --tls-cert");
  if (!tls.client_ca.empty() && tls.certificate.empty()) {
    return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key: only TLS has certificates");
  }
  if (flags->client_auth != ClientAuth::kNone && tls.client_ca.empty()) {
    return absl::InvalidArgumentError("--tls-client-auth needs --tls-client-ca: who signs certificates of clients");
  }
  if (flags->client_auth == ClientAuth::kNone && !tls.client_ca.empty()) flags->client_auth = ClientAuth::kRequire;

  const std::string open = OpenAddress(listen);
  if (open.empty() || flags->insecure) return absl::OkStatus();
  if (tls.certificate.empty()) {
    return absl::InvalidArgumentError(
        "other machines reach " + open +
        ", and nothing that passes would be encrypted: give --tls-cert and --tls-key (deploy/certificates.sh makes "
        "some to try), or --insecure on a network that is trusted, or listen on 127.0.0.1");
  }
  if (flags->access_file.empty() && flags->client_auth != ClientAuth::kRequire) {
    return absl::InvalidArgumentError(
        "other machines reach " + open +
        ", and whoever connects could do everything: give --access-file with tokens, or --tls-client-ca for client "
        "certificates, or --insecure on a network that is trusted, or listen on 127.0.0.1");
  }
  return absl::OkStatus();
}

}  // namespace planish
