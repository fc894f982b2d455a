#include "server/http/route.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/status.h"

namespace romap::http {
namespace {

constexpr std::string_view kPrefix = "/api/v1/";
constexpr std::string_view kGlb = ".glb";
constexpr size_t kMaxIdLength = 64;

std::vector<std::string_view> Split(std::string_view path) {
  std::vector<std::string_view> parts;
  while (true) {
    const size_t slash = path.find('/');
    parts.push_back(path.substr(0, slash));
    if (slash == std::string_view::npos) return parts;
    path.remove_prefix(slash + 1);
  }
}

std::optional<uint64_t> ParseCount(std::string_view text) {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

bool IsId(std::string_view text) {
  return !text.empty() && text.size() <= kMaxIdLength &&
         std::ranges::all_of(text, [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_'; });
}

// Of `parts` after "objects".
std::optional<Route> ParseObjectRoute(std::span<const std::string_view> parts) {
  Route route;
  if (parts.size() == 1 && parts[0].ends_with(kGlb)) {
    const auto object = ParseCount(parts[0].substr(0, parts[0].size() - kGlb.size()));
    if (!object) return std::nullopt;
    route.resource = Resource::kObjectGlb;
    route.object = *object;
    return route;
  }
  if (parts.size() < 3 || parts[1] != "mesh") return std::nullopt;
  const auto object = ParseCount(parts[0]), revision = ParseCount(parts[2]);
  if (!object || !revision) return std::nullopt;
  route.object = *object;
  route.revision = *revision;
  if (parts.size() == 3) {
    route.resource = Resource::kMesh;
    return route;
  }
  if (parts.size() == 4 && parts[3] == "texture") {
    route.resource = Resource::kMeshTexture;
    return route;
  }
  const auto level = parts.size() == 5 && parts[3] == "levels" ? ParseCount(parts[4]) : std::nullopt;
  if (!level) return std::nullopt;
  route.resource = Resource::kMeshLevel;
  route.level = *level;
  return route;
}

// Of `parts` after the id of the session.
std::optional<Route> ParseSessionRoute(std::span<const std::string_view> parts) {
  if (parts.empty()) return Route{.resource = Resource::kSession};
  if (parts[0] == "objects") return ParseObjectRoute(parts.subspan(1));
  if (parts.size() != 1) return std::nullopt;
  static constexpr std::pair<std::string_view, Resource> kNames[] = {
      {"finish", Resource::kFinish},         {"pin", Resource::kPin},       {"events", Resource::kEvents},
      {"map.glb", Resource::kMapGlb},        {"points", Resource::kPoints}, {"frame.jpg", Resource::kImage},
      {"trajectory", Resource::kTrajectory}, {"frames", Resource::kFrames},
  };
  const auto found = std::ranges::find(kNames, parts[0], &std::pair<std::string_view, Resource>::first);
  if (found == std::end(kNames)) return std::nullopt;
  return Route{.resource = found->second};
}

bool HasMethod(Resource resource, Method method) {
  switch (resource) {
    case Resource::kSessions:
      return method == Method::kGet || method == Method::kPost;
    case Resource::kSession:
      return method == Method::kGet || method == Method::kDelete;
    case Resource::kFinish:
    case Resource::kPin:
    case Resource::kFrames:
      return method == Method::kPost;
    default:
      return method == Method::kGet;
  }
}

}  // namespace

absl::StatusOr<Route> ParseRoute(Method method, std::string_view path) {
  std::optional<Route> route;
  if (path.starts_with(kPrefix)) {
    const std::vector<std::string_view> parts = Split(path.substr(kPrefix.size()));
    if (parts.size() == 1 && parts[0] == "server") route = Route{.resource = Resource::kServer};
    if (parts.size() == 1 && parts[0] == "sessions") route = Route{.resource = Resource::kSessions};
    if (parts.size() >= 2 && parts[0] == "sessions" && IsId(parts[1])) {
      route = ParseSessionRoute(std::span(parts).subspan(2));
      if (route) route->session_id = parts[1];
    }
  }
  if (!route) return NotFound("there is no such resource; see server/http/README.md");
  if (!HasMethod(route->resource, method)) {
    return absl::UnimplementedError("the resource does not have this method");
  }
  return *std::move(route);
}

}  // namespace romap::http
