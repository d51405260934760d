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

// For each step: connect, the handshake, what the server says then.
constexpr int kStepSeconds = 2;
constexpr unsigned int kNapMilliseconds = 5;

struct Free {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(SSL* ssl) const { SSL_free(ssl); }
  void operator()(BIO* bio) const { BIO_free(bio); }
};
template <typename T>
using Owned = std::unique_ptr<T, Free>;

void Trust(SSL_CTX* context, const std::string& ca) {
  if (ca.empty()) SSL_CTX_set_default_verify_paths(context);
  for (const CertificatePtr& root : CertificatesIn(ca)) {
    X509_STORE_add_cert(SSL_CTX_get_cert_store(context), root.get());
  }
}

// What is wrong with the client's own files; empty if nothing.
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

// What `step` comes to, or where it stands when the time is up.
template <typename Call>
int Step(SSL* ssl, BIO* socket, const Call& call) {
  const std::time_t end = std::time(nullptr) + kStepSeconds;
  int result = call();
  while (result <= 0 && BIO_should_retry(socket) && SSL_want(ssl) != SSL_NOTHING &&
         BIO_wait(socket, end, kNapMilliseconds) > 0) {
    result = call();
  }
  return result;
}

// The server asks for a client certificate.
int OnAsked(SSL*, void* asked) {
  *static_cast<bool*>(asked) = true;
  return 1;
}

// A server of gRPC closes the connection without an alert where it does not like the client's certificate.
std::string ExplainClosed(SSL* ssl, bool asked, bool has_certificate) {
  if (!asked) return "";
  const X509* certificate = SSL_get_certificate(ssl);
  if (!has_certificate || certificate == nullptr) return "the server asks for a client certificate";
  const bool has_expired = X509_cmp_current_time(X509_get0_notAfter(certificate)) < 0;
  return has_expired ? "the client certificate has expired" : "the server refuses the client certificate";
}

// The last error of a handshake or of a read after it.
std::string Explain(SSL* ssl, const std::string& name, bool has_certificate) {
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
  if (reason == SSL_R_TLSV13_ALERT_CERTIFICATE_REQUIRED ||
      (reason == SSL_R_SSLV3_ALERT_HANDSHAKE_FAILURE && !has_certificate)) {
    return "the server asks for a client certificate";
  }
  // Alerts about certificates, of either version of TLS.
  if (reason == SSL_R_SSLV3_ALERT_CERTIFICATE_EXPIRED) return "the client certificate has expired";
  if (has_certificate && reason >= SSL_AD_REASON_OFFSET) {
    return std::string("the server refuses the client certificate (") + ERR_reason_error_string(error) + ")";
  }
  return "";
}

}  // namespace

std::string FindTlsFault(const std::string& target, const TlsProbe& probe) {
  const std::optional<HostPort> address = ParseHostPort(target);
  if (!address) return "";
  const Owned<SSL_CTX> context(SSL_CTX_new(TLS_client_method()));
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  SSL_CTX_set_verify(context.get(), probe.uses_tls ? SSL_VERIFY_PEER : SSL_VERIFY_NONE, nullptr);
  Trust(context.get(), probe.ca);
  if (std::string fault = Present(context.get(), probe); !fault.empty()) return fault;
  Owned<BIO> socket(BIO_new_connect(target.c_str()));
  BIO_set_nbio(socket.get(), 1);
  if (BIO_do_connect_retry(socket.get(), kStepSeconds, kNapMilliseconds) != 1) return "";
  const Owned<SSL> ssl(SSL_new(context.get()));
  const unsigned char http2[] = {2, 'h', '2'};
  SSL_set_alpn_protos(ssl.get(), http2, sizeof(http2));
  const std::string name = probe.server_name.empty() ? address->host : probe.server_name;
  ExpectName(ssl.get(), name);
  SSL_set_bio(ssl.get(), socket.get(), socket.get());
  BIO* const connected = socket.release();  // the SSL's own
  ERR_clear_error();
  bool asked = false;
  SSL_set_cert_cb(ssl.get(), OnAsked, &asked);
  int result = Step(ssl.get(), connected, [&] { return SSL_connect(ssl.get()); });
  const bool is_done = result == 1;
  if (!probe.uses_tls) {
    // An alert is an answer in TLS as well: the server may ask for a client certificate, say.
    const unsigned long error = ERR_peek_error();
    const bool is_alert = ERR_GET_LIB(error) == ERR_LIB_SSL && ERR_GET_REASON(error) >= SSL_AD_REASON_OFFSET;
    return is_done || is_alert ? "the server there speaks TLS only" : "";
  }
  // With TLS 1.3 a server judges the client's certificate after the client is done; it says so instead of its first
  // HTTP/2 frame.
  char byte = 0;
  if (is_done) result = Step(ssl.get(), connected, [&] { return SSL_read(ssl.get(), &byte, 1); });
  if (result > 0 || SSL_get_error(ssl.get(), result) == SSL_ERROR_WANT_READ) return "";  // all is well, or too slow
  const bool has_certificate = !probe.certificate.empty();
  const std::string fault = Explain(ssl.get(), name, has_certificate);
  return fault.empty() ? ExplainClosed(ssl.get(), asked, has_certificate) : fault;
}

}  // namespace planish
