#pragma once

#include <absl/status/statusor.h>

#include <optional>

#include "common/mapping_service.h"
#include "server/http/message.h"

namespace romap::http {

// The meshes of a map, or of one object, as a GLB file in the world frame. NOT_FOUND: there is no such object, or it
// has no mesh yet. A map without meshes is an empty scene.
absl::StatusOr<HttpResponse> GlbResponse(const MapSnapshot& map, std::optional<ObjectId> object);
// A JSON array of TrajectoryPoint.
HttpResponse TrajectoryResponse(MapSnapshot map);
// Little-endian float32 x y z per point, with the headers X-Romap-Revision and X-Romap-Map-Id.
HttpResponse PointsResponse(const SparsePoints& points);

}  // namespace romap::http
