#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "server/http/message.h"

namespace romap::http {

// What a request below /api/v1 asks for.
enum class Resource {
  kServer,
  kSessions,
  kSession,
  kFinish,
  kPin,
  kEvents,
  kMesh,
  kMeshLevel,
  kMeshTexture,
  kObjectGlb,
  kMapGlb,
  kTrajectory,
  kPoints,
  kImage,
  kFrames,
};

struct Route {
  Resource resource = Resource::kServer;
  std::string session_id = {};
  uint64_t object = 0;
  uint64_t revision = 0;
  uint64_t level = 0;
};

// NOT_FOUND: there is no such resource. UNIMPLEMENTED: it does not have this method.
absl::StatusOr<Route> ParseRoute(Method method, std::string_view path);

}  // namespace romap::http
