#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <google/protobuf/message.h>

#include <string>

#include "common/map_events.h"
#include "common/mapping_service.h"

namespace romap::http {

// The JSON mapping of protobuf, with all fields that have a value or are of a primitive type.
std::string ToJson(const google::protobuf::Message& message);
// INVALID_ARGUMENT: not JSON, an unknown field, or more than 64 KiB.
absl::Status FromJson(const std::string& json, google::protobuf::Message* message);

std::string OpenedJson(const std::string& session_id, StreamOpening opening);
// The event as JSON; the bytes of a mesh are replaced by their numbers.
std::string EventJson(MapEvent event);
// The same for a mesh, which is not copied.
std::string MeshJson(const MeshUpdate& mesh);

}  // namespace romap::http
