#include "server/http/map_download.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <list>
#include <utility>
#include <vector>

#include "common/gltf/glb.h"
#include "common/mesh_codec.h"
#include "common/printable.h"
#include "common/status.h"
#include "common/wire/sessions.h"
#include "server/http/json.h"

namespace romap::http {
namespace {

static_assert(std::endian::native == std::endian::little, "points are sent as they are in memory");

void SetFileName(const std::string& name, HttpResponse* response) {
  response->headers.emplace_back("Content-Disposition", fmt::format("attachment; filename=\"{}\"", name));
}

GlbObject PlacedMesh(const ObjectSnapshot& snapshot, const Mesh* mesh) {
  const ObjectUpdate& object = snapshot.object;
  const SE3<World, Object> T_world_mesh = object.T_world_mesh.value_or(object.cuboid.T_world_object);
  return {.mesh = mesh,
          .S_world_mesh = {object.mesh_scale, T_world_mesh.rotation(), T_world_mesh.translation()},
          .texture = snapshot.mesh->texture,
          .name = fmt::format("{}_{}", object.id.value, Printable(object.class_name))};
}

}  // namespace

absl::StatusOr<HttpResponse> GlbResponse(const MapSnapshot& map, std::optional<ObjectId> object) {
  std::list<Mesh> meshes;
  std::vector<GlbObject> placed;
  for (const ObjectSnapshot& snapshot : map.objects) {
    if (!snapshot.mesh || (object && snapshot.object.id != *object)) continue;
    auto mesh = DecodeDraco(snapshot.mesh->draco);
    if (!mesh.ok()) {
      spdlog::warn("http: session {}: the mesh of {} cannot be decoded: {}", map.session_id,
                   snapshot.object.id.ToString(), Message(mesh.status()));
      continue;
    }
    placed.push_back(PlacedMesh(snapshot, &meshes.emplace_back(*std::move(mesh))));
  }
  if (object && placed.empty()) return NotFound("{} does not exist, or it has no mesh yet", object->ToString());
  ROMAP_ASSIGN_OR_RETURN(std::string glb, EncodeGlb(placed, "map"));
  HttpResponse response = TextResponse("model/gltf-binary", std::move(glb));
  SetFileName(object ? fmt::format("object_{}.glb", object->value) : fmt::format("map_{}.glb", map.session_id),
              &response);
  return response;
}

HttpResponse TrajectoryResponse(MapSnapshot map) {
  map.objects.clear();
  std::string json;
  for (const v1::ExportMapResponse& part : wire::ToProto(std::move(map))) {
    for (const v1::TrajectoryPoint& point : part.trajectory().points()) {
      json += json.empty() ? "[" : ",";
      json += ToJson(point);
    }
  }
  return JsonResponse(json.empty() ? "[]" : json + "]");
}

HttpResponse PointsResponse(const SparsePoints& points) {
  std::string bytes(points.positions_world.size() * sizeof(Eigen::Vector3f), '\0');
  static_assert(sizeof(Eigen::Vector3f) == 12);
  if (!bytes.empty()) std::memcpy(bytes.data(), points.positions_world.data(), bytes.size());
  HttpResponse response = TextResponse("application/octet-stream", std::move(bytes));
  response.headers.emplace_back("X-Romap-Revision", std::to_string(points.revision));
  response.headers.emplace_back("X-Romap-Map-Id", std::to_string(points.map_id.value));
  return response;
}

}  // namespace romap::http
