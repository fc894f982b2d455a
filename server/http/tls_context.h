#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/transport/tls_files.h"
#include "server/transport/transport_config.h"

struct bufferevent;
struct event_base;
struct ssl_ctx_st;

namespace romap::http {

// TLS for HTTP connections with the certificate files of the gRPC service: they are checked in the same way and used
// again when they change. Not thread-safe.
class TlsContext {
 public:
  // Null: the configuration has no TLS. Errors as TlsFiles::Load().
  static absl::StatusOr<std::unique_ptr<TlsContext>> Load(const transport::TransportConfig& config);

  // A connection that accepts a handshake, with the newest certificate; null: out of memory.
  bufferevent* NewConnection(event_base* base);

 private:
  using Context = std::unique_ptr<ssl_ctx_st, void (*)(ssl_ctx_st*)>;

  explicit TlsContext(std::unique_ptr<transport::TlsFiles> files);
  static absl::StatusOr<Context> Make(const transport::TlsFiles::Contents& contents);

  const std::unique_ptr<transport::TlsFiles> files_;
  std::shared_ptr<const transport::TlsFiles::Contents> used_;  // by context_
  Context context_;
};

}  // namespace romap::http
