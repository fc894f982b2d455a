#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/map_events.h"

namespace romap::store {

// The content of blobs: messages of romap.v1. Parsing returns DATA_LOSS if the bytes are not such a message.

std::string InputContent(const SessionInput& input);  // a MapRequest with `frame` or `late_masks`
absl::StatusOr<SessionInput> ParseInput(const std::string& content);

std::string ObjectContent(const ObjectUpdate& object);  // an ObjectUpdate
absl::StatusOr<ObjectUpdate> ParseObject(const std::string& content);

std::string MeshContent(const MeshUpdate& mesh);  // a MeshUpdate
absl::StatusOr<MeshUpdate> ParseMesh(const std::string& content);

// A TrajectoryPiece. The two arrays have the same length.
std::string TrajectoryContent(const std::vector<FrameAck>& frames, const std::vector<int64_t>& timestamps_ns);
absl::Status ParseTrajectory(const std::string& content, std::vector<FrameAck>* frames,
                             std::vector<int64_t>* timestamps_ns);

}  // namespace romap::store
