#pragma once

#include <absl/status/statusor.h>

#include "common/mapping_service.h"
#include "server/access/authenticator.h"
#include "server/http/mesh_cache.h"
#include "server/http/message.h"
#include "server/http/route.h"

namespace romap::http {

// Answers the requests below /api/v1 that are one call of the mapping service: all but events and frames. The calls may
// block. Thread-safe.
class Api {
 public:
  // Both outlive the object. `max_body_bytes`: what clients are told about the size of frames.
  Api(const access::Authenticator* authenticator, MeshCache* meshes, size_t max_body_bytes)
      : authenticator_(authenticator), meshes_(meshes), max_body_bytes_(max_body_bytes) {}

  HttpResponse Respond(const Route& route, const HttpRequest& request) const;

 private:
  absl::StatusOr<HttpResponse> Call(MappingService& service, const Route& route, const HttpRequest& request) const;
  absl::StatusOr<HttpResponse> CreateSession(MappingService& service, const HttpRequest& request) const;
  absl::StatusOr<HttpResponse> DeleteSession(MappingService& service, const std::string& session_id) const;
  absl::StatusOr<HttpResponse> PinSession(MappingService& service, const Route& route,
                                          const HttpRequest& request) const;
  absl::StatusOr<HttpResponse> Mesh(MappingService& service, const Route& route) const;

  const access::Authenticator* const authenticator_;
  MeshCache* const meshes_;
  const size_t max_body_bytes_;
};

}  // namespace romap::http
