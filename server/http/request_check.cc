#include "server/http/request_check.h"

#include <arpa/inet.h>

#include <algorithm>
#include <cctype>
#include <string>

#include "common/status.h"

namespace romap::http {
namespace {

bool IsPort(std::string_view text) {
  return text.empty() || (text.front() == ':' && text.size() <= 6 &&
                          std::all_of(text.begin() + 1, text.end(), [](unsigned char c) { return std::isdigit(c); }));
}

bool Parses(int family, std::string_view text) {
  in6_addr address{};
  return inet_pton(family, std::string(text).c_str(), &address) == 1;
}

}  // namespace

bool IsLocalOrNumber(std::string_view host) {
  if (host.starts_with('[')) {
    const size_t end = host.find(']');
    return end != std::string_view::npos && IsPort(host.substr(end + 1)) && Parses(AF_INET6, host.substr(1, end - 1));
  }
  const size_t colon = std::min(host.find(':'), host.size());
  const std::string_view name = host.substr(0, colon);
  return IsPort(host.substr(colon)) && (name == "localhost" || Parses(AF_INET, name));
}

absl::Status CheckRequest(const HttpRequest& request, bool is_loopback) {
  if (is_loopback && !IsLocalOrNumber(request.host)) {
    return absl::PermissionDeniedError(
        fmt::format("this server is reached as localhost or by its number, not as '{}'", request.host.substr(0, 100)));
  }
  if (request.method == Method::kGet || request.has_romap_header) return absl::OkStatus();
  const bool is_frame = request.path.ends_with("/frames");
  if (request.content_type == (is_frame ? "image/jpeg" : "application/json")) return absl::OkStatus();
  return InvalidArgument("the request needs the header 'Content-Type: {}' or 'X-Romap: 1'",
                         is_frame ? "image/jpeg" : "application/json");
}

}  // namespace romap::http
