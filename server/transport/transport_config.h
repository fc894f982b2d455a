#pragma once

#include <string>

#include "common/config.h"

namespace romap::transport {

struct TransportConfig {
  std::string listen_address = "127.0.0.1:50051";
  int max_message_bytes = 32 << 20;
  int max_calls = 256;
  int max_connections = 512;
  int max_connections_per_peer = 256;
  std::string tls_certificate, tls_key, tls_client_ca;
  bool reflection = true;
  double handshake_timeout_s = 10;
  double keepalive_s = 20;
  double shutdown_grace_s = 2;

  void Fields(ConfigFields& fields) {
    fields.Add("listen_address", &listen_address,
               {.audience = Audience::kOperator, .help = "HOST:PORT of the gRPC service; port 0 = any free port"});
    fields.Add("max_message_bytes", &max_message_bytes,
               {.unit = "bytes",
                .min = 1 << 16,
                .max = 1 << 30,
                .audience = Audience::kOperator,
                .help = "Maximum size of a message in either direction"});
    fields.Add("max_calls", &max_calls,
               {.unit = "calls",
                .min = 1,
                .max = 4096,
                .audience = Audience::kOperator,
                .help = "Maximum number of simultaneous calls and streams; each one uses a thread"});
    fields.Add("max_connections", &max_connections,
               {.unit = "connections",
                .min = 1,
                .max = 65536,
                .help = "Maximum number of connections; fewer if the process may not open that many files"});
    fields.Add(
        "max_connections_per_peer", &max_connections_per_peer,
        {.unit = "connections", .min = 1, .max = 65536, .help = "Maximum number of connections from one address"});
    fields.Add("tls_certificate", &tls_certificate,
               {.audience = Audience::kOperator,
                .help = "PEM file with the certificate of the server and those that signed it; empty = no TLS. The "
                        "three files are read again when they change"});
    fields.Add("tls_key", &tls_key,
               {.audience = Audience::kOperator, .help = "PEM file with the private key of the certificate"});
    fields.Add("tls_client_ca", &tls_client_ca,
               {.audience = Audience::kOperator,
                .help = "PEM file with the certificates that must have signed those of the clients; empty = clients "
                        "need no certificate"});
    fields.Add("reflection", &reflection,
               {.help = "Let clients list the calls of the service (gRPC server reflection); only on loopback "
                        "addresses"});
    fields.Add("handshake_timeout_s", &handshake_timeout_s,
               {.unit = "s",
                .min = 0.1,
                .max = 600,
                .help = "Time in which a new connection must be ready for calls, and a Map call must begin"});
    fields.Add("keepalive_s", &keepalive_s,
               {.unit = "s",
                .min = 1,
                .max = 3600,
                .help = "Time without traffic after which the server pings a client; a client that does not respond "
                        "within the same time is disconnected"});
    fields.Add("shutdown_grace_s", &shutdown_grace_s,
               {.unit = "s", .min = 0, .max = 60, .help = "Time for clients to read pending messages at shutdown"});
  }
};

}  // namespace romap::transport
