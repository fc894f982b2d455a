#pragma once

#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "client/files/sequence.h"
#include "common/messages.h"

namespace romap {

// A frame of a sequence with everything that is truly known of it.
struct TrueFrame {
  KeyframeId id;
  CameraModel camera;
  SE3<World, Camera> T_world_camera;
  cv::Mat image_bgr;
  cv::Mat labels;    // CV_16UC1, 0 = nothing
  cv::Mat depth_mu;  // CV_32FC1 z depth, 0 = unknown; empty when there is none
};

// Every `every`-th frame from `offset` on that has masks and a true pose, decoded.
absl::StatusOr<std::vector<TrueFrame>> LoadTrueFrames(const Sequence& sequence, int offset, int every);

// What the frame shows of an object, its label being its id: the crop around the projected cuboid, half as large again,
// and the mask. Nothing when fewer than 100 pixels of it are seen.
std::optional<ObjectView> MakeTrueView(const TrueFrame& frame, const ObjectRecord& object);

}  // namespace romap
