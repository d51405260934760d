#include "client/src/tls_probe.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <ctime>
#include <memory>
#include <vector>

#include "core/base/pem.h"
#include "core/base/target.h"

namespace planish {
namespace {

// Time limit of each of two steps: connecting with the handshake, and the server's reaction to it.
constexpr int kStepSeconds = 2;
constexpr int kNapMilliseconds = 5;

// Gives the client certificate and its key to `context`. Returns the error; empty if both are accepted.
std::string Present(SSL_CTX* context, const TlsProbe& probe) {
  if (probe.certificate.empty()) return "";
  const std::vector<CertificatePtr> chain = CertificatesIn(probe.certificate);
  const KeyPtr key = KeyIn(probe.key);
  if (chain.empty()) return "the client certificate cannot be read";
  if (key == nullptr) return "the client's key cannot be read";
  if (SSL_CTX_use_certificate(context, chain[0].get()) != 1 || SSL_CTX_use_PrivateKey(context, key.get()) != 1) {
    return "the client certificate does not belong to the client's key";
  }
  for (std::size_t i = 1; i < chain.size(); ++i) SSL_CTX_add1_chain_cert(context, chain[i].get());
  return "";
}

void ExpectName(SSL* ssl, const std::string& name) {
  X509_VERIFY_PARAM* rules = SSL_get0_param(ssl);
  if (X509_VERIFY_PARAM_set1_ip_asc(rules, name.c_str()) == 1) return;
  ERR_clear_error();
  X509_VERIFY_PARAM_set1_host(rules, name.c_str(), name.size());
  SSL_ctrl(ssl, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, const_cast<char*>(name.c_str()));
}

// Explains the last error of a handshake or of a read after it.
std::string Explain(SSL* ssl, const std::string& name, bool asked) {
  const unsigned long error = ERR_peek_error();
  const int reason = ERR_GET_LIB(error) == ERR_LIB_SSL ? ERR_GET_REASON(error) : 0;
  if (reason == SSL_R_WRONG_VERSION_NUMBER || reason == SSL_R_PACKET_LENGTH_TOO_LONG) {
    return "the server there does not speak TLS";
  }
  const long verdict = SSL_get_verify_result(ssl);
  if (reason == SSL_R_CERTIFICATE_VERIFY_FAILED && verdict != X509_V_OK) {
    const std::string text = X509_verify_cert_error_string(verdict);
    if (verdict == X509_V_ERR_HOSTNAME_MISMATCH || verdict == X509_V_ERR_IP_ADDRESS_MISMATCH) {
      return "the server's certificate is not for " + name + " (" + text + ")";
    }
    if (verdict == X509_V_ERR_CERT_HAS_EXPIRED) return "the server's certificate has expired";
    return "the server's certificate cannot be trusted (" + text + ")";
  }
  // If the server asked for a client certificate, other errors are about that certificate. A gRPC server closes the
  // connection without an alert.
  if (!asked) return "";
  const X509* certificate = SSL_get_certificate(ssl);
  if (certificate == nullptr) return "the server asks for a client certificate";
  if (X509_cmp_current_time(X509_get0_notAfter(certificate)) < 0 || reason == SSL_R_SSLV3_ALERT_CERTIFICATE_EXPIRED) {
    return "the client certificate has expired";
  }
  const bool is_alert = reason >= SSL_AD_REASON_OFFSET;
  return "the server refuses the client certificate" +
         (is_alert ? std::string(" (") + ERR_reason_error_string(error) + ")" : "");
}

}  // namespace

std::string FindTlsFault(const std::string& target, const TlsProbe& probe) {
  const std::optional<HostPort> address = ParseHostPort(target);
  if (!address) return "";
  const std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context(SSL_CTX_new(TLS_client_method()), &SSL_CTX_free);
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  SSL_CTX_set_verify(context.get(), probe.uses_tls ? SSL_VERIFY_PEER : SSL_VERIFY_NONE, nullptr);
  if (probe.ca.empty()) SSL_CTX_set_default_verify_paths(context.get());
  for (const CertificatePtr& root : CertificatesIn(probe.ca)) {
    X509_STORE_add_cert(SSL_CTX_get_cert_store(context.get()), root.get());
  }
  if (std::string fault = Present(context.get(), probe); !fault.empty()) return fault;
  bool asked = false;  // whether the server asked for a client certificate
  const auto on_asked = [](SSL*, void* flag) { return static_cast<int>(*static_cast<bool*>(flag) = true); };
  SSL_CTX_set_cert_cb(context.get(), on_asked, &asked);
  const unsigned char http2[] = {2, 'h', '2'};
  SSL_CTX_set_alpn_protos(context.get(), http2, sizeof(http2));

  const std::unique_ptr<BIO, decltype(&BIO_free_all)> link(BIO_new_ssl_connect(context.get()), &BIO_free_all);
  BIO_set_conn_hostname(link.get(), target.c_str());
  SSL* ssl = nullptr;
  BIO_get_ssl(link.get(), &ssl);
  const std::string name = probe.server_name.empty() ? address->host : probe.server_name;
  ExpectName(ssl, name);
  ERR_clear_error();
  int result = BIO_do_connect_retry(link.get(), kStepSeconds, kNapMilliseconds);
  if (!probe.uses_tls) {
    // An alert also shows that the server speaks TLS; it may want a client certificate.
    const unsigned long error = ERR_peek_error();
    const bool is_alert = ERR_GET_LIB(error) == ERR_LIB_SSL && ERR_GET_REASON(error) >= SSL_AD_REASON_OFFSET;
    return result == 1 || is_alert ? "the server there speaks TLS only" : "";
  }
  // With TLS 1.3 a server checks the client's certificate after the client has finished the handshake. It then sends an
  // alert instead of its first HTTP/2 frame.
  if (result == 1) {
    const std::time_t end = std::time(nullptr) + kStepSeconds;
    char byte = 0;
    do {
      result = BIO_read(link.get(), &byte, 1);
    } while (result <= 0 && BIO_should_retry(link.get()) && BIO_wait(link.get(), end, kNapMilliseconds) > 0);
  }
  const bool is_fine_or_slow = result > 0 || BIO_should_retry(link.get());
  return is_fine_or_slow ? "" : Explain(ssl, name, asked);
}

}  // namespace planish
