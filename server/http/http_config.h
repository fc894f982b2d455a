#pragma once

#include <string>

#include "common/config.h"

namespace romap::http {

inline constexpr const char* kDefaultListenAddress = "127.0.0.1:8080";

struct HttpConfig {
  std::string listen_address = kDefaultListenAddress;
  int max_connections = 512;
  int max_connections_per_peer = 256;
  int max_viewers = 64;
  int max_body_bytes = 16 << 20;
  int workers = 4;
  double request_timeout_s = 20;
  double response_timeout_s = 120;

  void Fields(ConfigFields& fields) {
    fields.Add("listen_address", &listen_address,
               {.help = "HOST:PORT of the page and its HTTP interface; port 0 = any free port; empty = off. If the "
                        "default is in use, the server goes on without it"});
    fields.Add("max_connections", &max_connections,
               {.unit = "connections", .min = 1, .max = 65536, .help = "Maximum number of HTTP connections"});
    fields.Add(
        "max_connections_per_peer", &max_connections_per_peer,
        {.unit = "connections", .min = 1, .max = 65536, .help = "Maximum number of HTTP connections from one address"});
    fields.Add("max_viewers", &max_viewers,
               {.unit = "streams", .min = 1, .max = 4096, .help = "Maximum number of simultaneous event streams"});
    fields.Add("max_body_bytes", &max_body_bytes,
               {.unit = "bytes", .min = 1 << 16, .max = 1 << 30, .help = "Maximum size of the body of a request"});
    fields.Add("workers", &workers,
               {.unit = "threads", .min = 1, .max = 64, .help = "Number of threads that answer HTTP requests"});
    fields.Add("request_timeout_s", &request_timeout_s,
               {.unit = "s",
                .min = 0.1,
                .max = 3600,
                .help = "Time in which a connection must send its next request completely; otherwise it is closed"});
    fields.Add("response_timeout_s", &response_timeout_s,
               {.unit = "s", .min = 0.1, .max = 3600, .help = "Time in which a client must have read a response"});
  }
};

}  // namespace romap::http
