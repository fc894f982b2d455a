#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <span>
#include <string>

#include "server/access/authenticator.h"
#include "server/http/assets.h"
#include "server/http/http_config.h"
#include "server/http/metrics.h"
#include "server/transport/transport_config.h"

namespace romap::http {

// Serves the page and the HTTP interface, see README.md. Has a thread for connections and a few for calls.
class HttpServer {
 public:
  struct Options {
    HttpConfig config = {};
    transport::TransportConfig tls = {};  // only its TLS files are used
    std::span<const Asset> assets = {};   // of the page
    MetricSources metrics = {};
  };

  // `authenticator` outlives the server. INVALID_ARGUMENT: the address is not HOST:PORT, or a TLS file is not what it
  // must be. UNAVAILABLE: cannot listen there, e.g. because another process does. RESOURCE_EXHAUSTED: too few threads
  // or too little memory.
  static absl::StatusOr<std::unique_ptr<HttpServer>> Start(const access::Authenticator* authenticator, Options options);
  ~HttpServer();  // Shutdown()

  const std::string& address() const;  // HOST:PORT with the chosen port
  std::string url() const;             // of the page, for people

  // Ends all streams and connections. A second call has no effect.
  void Shutdown();

 private:
  class Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace romap::http
