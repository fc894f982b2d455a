#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "client/files/objects_yaml.h"
#include "client/files/sequence.h"
#include "common/stage_messages.h"
#include "common/status.h"

namespace romap::bench {

// The training data of the benchmark: frames with true poses and masks. Nothing is tracked or associated.
using TrueFrames = std::vector<std::shared_ptr<const Frame>>;

// Loads every `every`-th frame of a sequence from `offset`, decoded and undistorted as on the server. Skips frames
// without a mask or a pose. INVALID_ARGUMENT: the labels are not the ids of objects.yaml. FAILED_PRECONDITION: no
// objects.yaml or no frames. Otherwise as Sequence::Load.
absl::StatusOr<TrueFrames> LoadTrueFrames(const files::Sequence& sequence, int every, int offset);

// The view of an object in a frame: the crop around its mask and its projected cuboid, enlarged by half. nullopt if the
// object has fewer than 100 pixels or extends behind the camera.
std::optional<ObjectView> MakeTrueView(const Frame& frame, const files::ObjectRecord& object, bool with_depth);

// The views of an object in all frames.
std::vector<ObjectView> MakeTrueViews(const TrueFrames& frames, const files::ObjectRecord& object, bool with_depth);

}  // namespace romap::bench
