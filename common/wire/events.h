#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "common/map_events.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// FromProto returns INVALID_ARGUMENT "<where>.<field>: ..." for a missing message, an unknown enum value, an id of 0,
// or a number that is not finite. `where` is the path of the message, e.g. "event".

v1::MapEvent ToProto(MapEvent event);
// Also INVALID_ARGUMENT: an unknown event kind (compatibility rule 3).
absl::StatusOr<MapEvent> FromProto(v1::MapEvent proto, const std::string& where);

v1::FrameAck ToProto(FrameAck ack);
absl::StatusOr<FrameAck> FromProto(v1::FrameAck proto, const std::string& where);

v1::ObjectUpdate ToProto(ObjectUpdate update);
absl::StatusOr<ObjectUpdate> FromProto(v1::ObjectUpdate proto, const std::string& where);

v1::MeshUpdate ToProto(MeshUpdate update);
absl::StatusOr<MeshUpdate> FromProto(v1::MeshUpdate proto, const std::string& where);

v1::Statistics ToProto(const Statistics& statistics);
absl::StatusOr<Statistics> FromProto(const v1::Statistics& proto, const std::string& where);

}  // namespace romap::wire
