#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace romap::testing_support {

// What a client with TLS trusts and who it is, PEM.
struct HttpTls {
  std::string ca;
  std::string certificate = {}, key = {};  // may be empty
};

struct HttpReply {
  int code = 0;
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
};

// A connection of a simple HTTP client that can also send what no proper client sends. Waits end after 30 s, as if the
// server had closed the connection.
class HttpConnection {
 public:
  // `address`: HOST:PORT. Null: refused, or the TLS handshake failed.
  static std::unique_ptr<HttpConnection> Open(const std::string& address, const std::optional<HttpTls>& tls = {});
  ~HttpConnection();

  // False: the server has closed the connection.
  bool Send(std::string_view bytes);
  // Sends a request. `headers`: further lines, each with \r\n at its end.
  bool Request(const std::string& method, const std::string& target, const std::string& headers = "",
               const std::string& body = "");
  // The next reply; nullopt: the connection was closed first.
  std::optional<HttpReply> Read();
  // Its head only, for a stream.
  std::optional<HttpReply> ReadHead();

  struct Event {
    std::string name, data;
  };
  // The next server-sent event of a chunked stream, without comments; nullopt: the stream has ended.
  std::optional<Event> NextEvent();

  // Waits until the server closes the connection; false after 30 s.
  bool IsClosedByServer();

 private:
  struct Tls;

  HttpConnection(int fd, std::string host);
  bool Receive();  // more bytes into buffer_; false: closed
  std::optional<std::string> ReadLine();
  bool ReadBytes(size_t count, std::string* bytes);
  bool ReadChunk(std::string* bytes);  // false: it was the last one, or the connection was closed

  const int fd_;
  const std::string host_;
  std::unique_ptr<Tls> tls_;
  std::string buffer_;
  std::string events_;  // decoded, not yet returned
};

// One request on a connection of its own.
std::optional<HttpReply> Fetch(const std::string& address, const std::string& method, const std::string& target,
                               const std::string& headers = "", const std::string& body = "",
                               const std::optional<HttpTls>& tls = {});

}  // namespace romap::testing_support
