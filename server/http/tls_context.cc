#include "server/http/tls_context.h"

#include <event2/bufferevent.h>
#include <event2/bufferevent_ssl.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "common/status.h"

namespace romap::http {
namespace {

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

Bio TextBio(const std::string& text) { return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free}; }

Certificate NextCertificate(BIO* bio) { return {PEM_read_bio_X509(bio, nullptr, nullptr, nullptr), X509_free}; }

bool UseCertificates(SSL_CTX* context, const std::string& pem) {
  const Bio bio = TextBio(pem);
  const Certificate own = NextCertificate(bio.get());
  if (!own || SSL_CTX_use_certificate(context, own.get()) != 1) return false;
  while (const Certificate signer = NextCertificate(bio.get())) {
    if (SSL_CTX_add1_chain_cert(context, signer.get()) != 1) return false;
  }
  ERR_clear_error();  // the end of the text is an error
  return true;
}

bool UseKey(SSL_CTX* context, const std::string& pem) {
  const Bio bio = TextBio(pem);
  const auto no_password = [](char*, int, int, void*) { return -1; };
  const Key key(PEM_read_bio_PrivateKey(bio.get(), nullptr, no_password, nullptr), EVP_PKEY_free);
  return key && SSL_CTX_use_PrivateKey(context, key.get()) == 1 && SSL_CTX_check_private_key(context) == 1;
}

bool RequireClientsOf(SSL_CTX* context, const std::string& pem) {
  const Bio bio = TextBio(pem);
  int count = 0;
  while (const Certificate authority = NextCertificate(bio.get())) {
    if (X509_STORE_add_cert(SSL_CTX_get_cert_store(context), authority.get()) != 1) return false;
    if (SSL_CTX_add_client_CA(context, authority.get()) != 1) return false;
    ++count;
  }
  ERR_clear_error();
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  return count > 0;
}

}  // namespace

TlsContext::TlsContext(std::unique_ptr<transport::TlsFiles> files)
    : files_(std::move(files)), context_(nullptr, SSL_CTX_free) {}

absl::StatusOr<std::unique_ptr<TlsContext>> TlsContext::Load(const transport::TransportConfig& config) {
  if (config.tls_certificate.empty() && config.tls_key.empty() && config.tls_client_ca.empty()) return nullptr;
  ROMAP_ASSIGN_OR_RETURN(auto files, transport::TlsFiles::Load(config));
  std::unique_ptr<TlsContext> tls(new TlsContext(std::move(files)));
  tls->used_ = tls->files_->installed();
  ROMAP_ASSIGN_OR_RETURN(tls->context_, Make(*tls->used_));
  return tls;
}

absl::StatusOr<TlsContext::Context> TlsContext::Make(const transport::TlsFiles::Contents& contents) {
  Context context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  if (!context) return Internal("TLS: OpenSSL cannot make a context");
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  SSL_CTX_set_options(context.get(), SSL_OP_NO_RENEGOTIATION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  SSL_CTX_set_mode(context.get(), SSL_MODE_RELEASE_BUFFERS);
  // Sessions would be resumed without a check of the client's certificate.
  SSL_CTX_set_session_cache_mode(context.get(), SSL_SESS_CACHE_OFF);
  SSL_CTX_set_options(context.get(), SSL_OP_NO_TICKET);
  SSL_CTX_set_num_tickets(context.get(), 0);
  if (!UseCertificates(context.get(), contents.certificate) || !UseKey(context.get(), contents.key) ||
      (!contents.client_ca.empty() && !RequireClientsOf(context.get(), contents.client_ca))) {
    return InvalidArgument("TLS: OpenSSL cannot use the certificate, its key or the certificates of the clients");
  }
  return context;
}

bufferevent* TlsContext::NewConnection(event_base* base) {
  if (auto newest = files_->installed(); newest != used_) {
    absl::StatusOr<Context> context = Make(*newest);
    if (context.ok()) {
      context_ = *std::move(context);
    } else {
      spdlog::warn("http: the old certificate stays in use: {}", Message(context.status()));
    }
    used_ = std::move(newest);
  }
  SSL* ssl = SSL_new(context_.get());
  if (ssl == nullptr) return nullptr;
  bufferevent* connection =
      bufferevent_openssl_socket_new(base, -1, ssl, BUFFEREVENT_SSL_ACCEPTING, BEV_OPT_CLOSE_ON_FREE);
  if (connection == nullptr) {
    SSL_free(ssl);
  } else {
    // Browsers close connections without the alert that TLS asks for.
    bufferevent_openssl_set_allow_dirty_shutdown(connection, 1);
  }
  return connection;
}

}  // namespace romap::http
