#include "common/host_port.h"

#include <arpa/inet.h>

#include <charconv>

namespace romap {

std::optional<HostPort> ParseHostPort(std::string_view address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return std::nullopt;
  const std::string_view digits = address.substr(colon + 1);
  HostPort result{.host = std::string(address.substr(0, colon))};
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), result.port);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  if (result.port < 0 || result.port > 65535) return std::nullopt;
  return result;
}

bool IsLoopback(const HostPort& address) {
  in_addr v4{};
  const bool is_v4 = inet_pton(AF_INET, address.host.c_str(), &v4) == 1;
  return address.host == "localhost" || address.host == "[::1]" || (is_v4 && address.host.starts_with("127."));
}

}  // namespace romap
