#include "tests/support/http_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <pthread.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace romap::testing_support {
namespace {

constexpr timeval kTimeout{.tv_sec = 30, .tv_usec = 0};

int ConnectTo(const std::string& address) {
  const size_t colon = address.rfind(':');
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_port = htons(static_cast<uint16_t>(std::atoi(address.c_str() + colon + 1)));
  inet_pton(AF_INET, address.substr(0, colon).c_str(), &server.sin_addr);
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &kTimeout, sizeof(kTimeout));
  // Small, so that a test notices soon what happens when a client does not read.
  const int receive_bytes = 1 << 16;
  setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof(receive_bytes));
  setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &kTimeout, sizeof(kTimeout));
  if (connect(fd, reinterpret_cast<const sockaddr*>(&server), sizeof(server)) == 0) return fd;
  close(fd);
  return -1;
}

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;

Bio BioOf(const std::string& text) { return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free}; }

std::string LowerCase(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

struct HttpConnection::Tls {
  SSL_CTX* context = SSL_CTX_new(TLS_client_method());
  SSL* ssl = nullptr;

  Tls() = default;
  ~Tls() {
    SSL_free(ssl);
    SSL_CTX_free(context);
  }
  Tls(const Tls&) = delete;
  Tls& operator=(const Tls&) = delete;

  bool Connect(int fd, const HttpTls& options) {
    // OpenSSL writes to connections that the server has closed. The signal goes to the thread that writes.
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    X509* ca = PEM_read_bio_X509(BioOf(options.ca).get(), nullptr, nullptr, nullptr);
    X509_STORE_add_cert(SSL_CTX_get_cert_store(context), ca);
    X509_free(ca);
    SSL_CTX_set_verify(context, SSL_VERIFY_PEER, nullptr);
    if (!options.certificate.empty()) {
      X509* own = PEM_read_bio_X509(BioOf(options.certificate).get(), nullptr, nullptr, nullptr);
      EVP_PKEY* key = PEM_read_bio_PrivateKey(BioOf(options.key).get(), nullptr, nullptr, nullptr);
      SSL_CTX_use_certificate(context, own);
      SSL_CTX_use_PrivateKey(context, key);
      X509_free(own);
      EVP_PKEY_free(key);
    }
    ssl = SSL_new(context);
    SSL_set_fd(ssl, fd);
    X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(ssl), "127.0.0.1");
    return SSL_connect(ssl) == 1;
  }
};

HttpConnection::HttpConnection(int fd, std::string host) : fd_(fd), host_(std::move(host)) {}

HttpConnection::~HttpConnection() {
  tls_.reset();
  close(fd_);
}

std::unique_ptr<HttpConnection> HttpConnection::Open(const std::string& address, const std::optional<HttpTls>& tls) {
  const int fd = ConnectTo(address);
  if (fd < 0) return nullptr;
  std::unique_ptr<HttpConnection> connection(new HttpConnection(fd, address));
  if (!tls) return connection;
  connection->tls_ = std::make_unique<Tls>();
  return connection->tls_->Connect(fd, *tls) ? std::move(connection) : nullptr;
}

bool HttpConnection::Send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = tls_ ? SSL_write(tls_->ssl, bytes.data(), static_cast<int>(bytes.size()))
                              : send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

bool HttpConnection::Request(const std::string& method, const std::string& target, const std::string& headers,
                             const std::string& body) {
  const bool has_length = !body.empty() || method == "POST";
  return Send(method + " " + target + " HTTP/1.1\r\nHost: " + host_ + "\r\n" + headers +
              (has_length ? "Content-Length: " + std::to_string(body.size()) + "\r\n" : "") + "\r\n" + body);
}

bool HttpConnection::Receive() {
  char bytes[16384];
  const ssize_t count = tls_ ? SSL_read(tls_->ssl, bytes, sizeof(bytes)) : recv(fd_, bytes, sizeof(bytes), 0);
  if (count <= 0) return false;
  buffer_.append(bytes, static_cast<size_t>(count));
  return true;
}

std::optional<std::string> HttpConnection::ReadLine() {
  size_t end = 0;
  while ((end = buffer_.find("\r\n")) == std::string::npos) {
    if (!Receive()) return std::nullopt;
  }
  std::string line = buffer_.substr(0, end);
  buffer_.erase(0, end + 2);
  return line;
}

bool HttpConnection::ReadBytes(size_t count, std::string* bytes) {
  while (buffer_.size() < count) {
    if (!Receive()) return false;
  }
  bytes->append(buffer_, 0, count);
  buffer_.erase(0, count);
  return true;
}

bool HttpConnection::ReadChunk(std::string* bytes) {
  const std::optional<std::string> size = ReadLine();
  if (!size) return false;
  const size_t count = std::strtoul(size->c_str(), nullptr, 16);
  const bool is_complete = ReadBytes(count, bytes);
  return ReadLine().has_value() && is_complete && count > 0;
}

std::optional<HttpReply> HttpConnection::ReadHead() {
  std::optional<std::string> line = ReadLine();
  if (!line || !line->starts_with("HTTP/1.1 ")) return std::nullopt;
  HttpReply reply{.code = std::atoi(line->c_str() + 9), .headers = {}, .body = {}};
  while ((line = ReadLine()) && !line->empty()) {
    const size_t colon = std::min(line->find(": "), line->size());
    reply.headers[LowerCase(line->substr(0, colon))] = line->substr(std::min(colon + 2, line->size()));
  }
  return reply;
}

std::optional<HttpReply> HttpConnection::Read() {
  std::optional<HttpReply> reply = ReadHead();
  if (!reply) return std::nullopt;
  if (reply->headers["transfer-encoding"] == "chunked") {
    while (ReadChunk(&reply->body)) {
    }
    return reply;
  }
  if (!ReadBytes(std::strtoul(reply->headers["content-length"].c_str(), nullptr, 10), &reply->body))
    return std::nullopt;
  return reply;
}

std::optional<HttpConnection::Event> HttpConnection::NextEvent() {
  while (true) {
    const size_t end = events_.find("\n\n");
    if (end == std::string::npos) {
      if (!ReadChunk(&events_)) return std::nullopt;
      continue;
    }
    const std::string text = events_.substr(0, end);
    events_.erase(0, end + 2);
    if (text.starts_with(':')) continue;
    const size_t data = text.find("\ndata: ");
    if (!text.starts_with("event: ") || data == std::string::npos) return Event{.name = "malformed", .data = text};
    return Event{.name = text.substr(7, data - 7), .data = text.substr(data + 7)};
  }
}

bool HttpConnection::IsClosedByServer() {
  char byte = 0;
  while (true) {
    const ssize_t count = recv(fd_, &byte, 1, 0);
    if (count == 0) return true;
    if (count < 0) return errno == ECONNRESET;
  }
}

std::optional<HttpReply> Fetch(const std::string& address, const std::string& method, const std::string& target,
                               const std::string& headers, const std::string& body, const std::optional<HttpTls>& tls) {
  const auto connection = HttpConnection::Open(address, tls);
  if (!connection || !connection->Request(method, target, headers, body)) return std::nullopt;
  return connection->Read();
}

}  // namespace romap::testing_support
