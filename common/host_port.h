#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace romap {

// The address of a server.
struct HostPort {
  std::string host;  // as given; IPv6 addresses in brackets
  int port = 0;      // 0, to listen: any free one
};

// nullopt: not HOST:PORT.
std::optional<HostPort> ParseHostPort(std::string_view address);
// Whether the address is of this machine alone. Only numbers and "localhost" count: a name may lead anywhere, also one
// that begins with "127.".
bool IsLoopback(const HostPort& address);

}  // namespace romap
