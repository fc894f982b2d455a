#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "client/files/objects_yaml.h"
#include "client/files/sequence.h"
#include "common/stage_messages.h"
#include "common/status.h"

namespace romap::bench {

// What benchmarks of the field engine train on: frames with their true poses and masks, and true cuboids. Nothing is
// tracked or associated.
using TrueFrames = std::vector<std::shared_ptr<const Frame>>;

// Every `every`-th frame of a sequence from `offset` on, decoded and undistorted as the server does it; frames without
// mask or pose are left out. Labels must be the ids of objects.yaml. INVALID_ARGUMENT / NOT_FOUND: a file is missing or
// broken, the detections name a label otherwise than objects.yaml, or no frame is left.
absl::StatusOr<TrueFrames> LoadTrueFrames(const files::Sequence& sequence, int every, int offset);

// The view of an object in a frame: the crop around its projected cuboid, half as large again, and its mask. nullopt
// when fewer than 100 pixels show it, or it reaches behind the camera.
std::optional<ObjectView> MakeTrueView(const Frame& frame, const files::ObjectRecord& object, bool with_depth);

// The views of an object in all frames that show it.
std::vector<ObjectView> MakeTrueViews(const TrueFrames& frames, const files::ObjectRecord& object, bool with_depth);

}  // namespace romap::bench
