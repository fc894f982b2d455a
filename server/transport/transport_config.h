#pragma once

#include <string>

#include "common/config.h"

namespace romap::transport {

struct TransportConfig {
  std::string listen_address = "127.0.0.1:50051";
  int max_message_bytes = 32 << 20;
  int max_calls = 256;
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
