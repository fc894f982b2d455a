#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace romap::transport {

// An address to listen on.
struct HostPort {
  std::string host;  // as given; IPv6 addresses in brackets
  int port = 0;      // 0: any free one
};

// nullopt: not HOST:PORT.
std::optional<HostPort> ParseHostPort(std::string_view address);
// Whether only processes of this machine reach the address.
bool IsLoopback(const HostPort& address);

}  // namespace romap::transport
