#include "server/http/api.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/status.h"
#include "common/version.h"
#include "common/wire/sessions.h"
#include "server/http/json.h"
#include "server/http/map_download.h"

namespace romap::http {
namespace {

constexpr int kImageSide_px = 640;
constexpr const char* kImmutable = "private, max-age=31536000, immutable";

HttpResponse SessionResponse(const SessionInfo& info) { return JsonResponse(ToJson(wire::ToProto(info))); }

// A part of a mesh, which is not copied.
HttpResponse MeshPart(const std::shared_ptr<const MeshUpdate>& mesh, const std::string& bytes,
                      std::string content_type) {
  return {.content_type = std::move(content_type),
          .body = bytes,
          .body_owner = mesh,
          .headers = {{"Cache-Control", kImmutable}}};
}

}  // namespace

HttpResponse Api::Respond(const Route& route, const HttpRequest& request) const {
  if (route.resource == Resource::kServer) {
    return JsonResponse(nlohmann::json{
        {"version", Version()}, {"needsToken", authenticator_->NeedsToken()}, {"maxMessageBytes", max_body_bytes_}}
                            .dump());
  }
  const absl::StatusOr<access::Caller> caller = authenticator_->Authenticate(request.authorization);
  if (!caller.ok()) return ErrorResponse(caller.status());
  try {
    absl::StatusOr<HttpResponse> response = Call(*caller->service, route, request);
    return response.ok() ? *std::move(response) : ErrorResponse(response.status());
  } catch (const std::exception& e) {
    spdlog::error("http: a call failed: {}", e.what());
    return ErrorResponse(Internal("the call failed: {}", e.what()));
  }
}

absl::StatusOr<HttpResponse> Api::Call(MappingService& service, const Route& route, const HttpRequest& request) const {
  const std::string& id = route.session_id;
  switch (route.resource) {
    case Resource::kSessions: {
      if (request.method == Method::kPost) return CreateSession(service, request);
      ROMAP_ASSIGN_OR_RETURN(const std::vector<SessionInfo> infos, service.ListSessions());
      v1::ListSessionsResponse list;
      for (const SessionInfo& info : infos) *list.add_sessions() = wire::ToProto(info);
      return JsonResponse(ToJson(list));
    }
    case Resource::kSession: {
      if (request.method == Method::kDelete) return DeleteSession(service, id);
      ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.GetSession(id));
      return SessionResponse(info);
    }
    case Resource::kFinish: {
      ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.FinishSession(id));
      return SessionResponse(info);
    }
    case Resource::kPin:
      return PinSession(service, route, request);
    case Resource::kMesh:
    case Resource::kMeshLevel:
    case Resource::kMeshTexture:
      return Mesh(service, route);
    case Resource::kObjectGlb:
    case Resource::kMapGlb: {
      ROMAP_ASSIGN_OR_RETURN(const MapSnapshot map, service.ExportMap(id));
      return GlbResponse(map,
                         route.resource == Resource::kMapGlb ? std::nullopt : std::optional(ObjectId{route.object}));
    }
    case Resource::kTrajectory: {
      ROMAP_ASSIGN_OR_RETURN(MapSnapshot map, service.ExportMap(id));
      return TrajectoryResponse(std::move(map));
    }
    case Resource::kPoints: {
      ROMAP_ASSIGN_OR_RETURN(const SparsePoints points, service.Points(id));
      return PointsResponse(points);
    }
    case Resource::kImage: {
      ROMAP_ASSIGN_OR_RETURN(CameraImage image, service.NewestImage(id, kImageSide_px));
      HttpResponse response = TextResponse("image/jpeg", std::move(image.jpeg));
      response.headers.emplace_back("X-Romap-Frame-Id", std::to_string(image.frame_id));
      return response;
    }
    default:
      return Internal("this resource is answered elsewhere");
  }
}

absl::StatusOr<HttpResponse> Api::CreateSession(MappingService& service, const HttpRequest& request) const {
  v1::CreateSessionRequest proto;
  ROMAP_RETURN_IF_ERROR(FromJson(request.body, &proto));
  ROMAP_ASSIGN_OR_RETURN(const SessionOptions options, wire::FromProto(proto));
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.CreateSession(options));
  v1::CreateSessionResponse response;
  *response.mutable_session() = wire::ToProto(info);
  return JsonResponse(ToJson(response));
}

absl::StatusOr<HttpResponse> Api::DeleteSession(MappingService& service, const std::string& session_id) const {
  ROMAP_RETURN_IF_ERROR(service.DeleteSession(session_id));
  meshes_->RemoveSession(session_id);
  return JsonResponse("{}");
}

absl::StatusOr<HttpResponse> Api::PinSession(MappingService& service, const Route& route,
                                             const HttpRequest& request) const {
  v1::PinSessionRequest proto;
  ROMAP_RETURN_IF_ERROR(FromJson(request.body, &proto));
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.PinSession(route.session_id, proto.pinned()));
  return SessionResponse(info);
}

absl::StatusOr<HttpResponse> Api::Mesh(MappingService& service, const Route& route) const {
  // Also whether the caller may see the session: the cache does not know that.
  ROMAP_RETURN_IF_ERROR(service.GetSession(route.session_id).status());
  const ObjectId object{route.object};
  std::shared_ptr<const MeshUpdate> mesh = meshes_->Find(route.session_id, object);
  if (!mesh || mesh->revision < route.revision) {
    ROMAP_ASSIGN_OR_RETURN(MapSnapshot map, service.ExportMap(route.session_id));
    const auto found = std::ranges::find(map.objects, object, [](const ObjectSnapshot& o) { return o.object.id; });
    if (found != map.objects.end() && found->mesh) mesh = meshes_->Put(route.session_id, *std::move(found->mesh));
  }
  if (!mesh || mesh->revision != route.revision) {
    return NotFound("{} has no mesh of revision {}, or a newer one", object.ToString(), route.revision);
  }
  if (route.resource == Resource::kMesh) return MeshPart(mesh, mesh->draco, "application/octet-stream");
  if (route.resource == Resource::kMeshLevel) {
    if (route.level >= mesh->levels.size()) {
      return NotFound("the mesh has {} simpler levels, from 0", mesh->levels.size());
    }
    return MeshPart(mesh, mesh->levels[route.level].draco, "application/octet-stream");
  }
  if (mesh->texture.image.empty()) return NotFound("the mesh has no texture");
  // The value comes from the server's own encoder; a stored map could have another one.
  const bool is_png = mesh->texture.media_type == "image/png";
  return MeshPart(mesh, mesh->texture.image, is_png ? "image/png" : "image/jpeg");
}

}  // namespace romap::http
