#include "client/cli/trackable.h"

#include <algorithm>
#include <cmath>

#include "client/cli/cuboid_outline.h"
#include "client/files/mapped_frames.h"
#include "common/label_png.h"

namespace romap::cli {
namespace {

// Minimum intersection over union of the bounding boxes of a mask and a cuboid that match. Low, because the outline of
// a cuboid is larger than that of the object inside it.
constexpr double kMinOverlap = 0.35;

struct Region {
  cv::Rect box;
  int area_px = 0;
};

std::map<int, Region> MaskRegions(const files::Sequence& sequence, size_t index) {
  std::map<int, Region> regions;
  if (!sequence.has_mask(index)) return regions;
  const auto frame = sequence.Load(index);
  if (!frame.ok() || frame->label_png.empty()) return regions;
  const absl::StatusOr<cv::Mat> decoded = DecodeLabelPng(frame->label_png);
  if (!decoded.ok()) return regions;
  const cv::Mat& labels = *decoded;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int label = labels.at<uint16_t>(y, x);
      if (label == 0) continue;
      Region& region = regions[label];
      region.box = region.area_px == 0 ? cv::Rect(x, y, 1, 1) : region.box | cv::Rect(x, y, 1, 1);
      ++region.area_px;
    }
  }
  return regions;
}

bool Fits(const Region& region, const cv::Rect2d& outline) {
  const cv::Rect2d box(region.box);
  const double shared = (box & outline).area();
  return region.area_px >= kTrackableArea_px && shared > kMinOverlap * (box.area() + outline.area() - shared);
}

}  // namespace

std::map<ObjectId, size_t> FirstTrackableFrames(const files::Sequence& sequence,
                                                const std::vector<files::StampedPose>& trajectory,
                                                const std::vector<MapObject>& objects) {
  std::map<ObjectId, size_t> first;
  std::map<ObjectId, std::vector<Eigen::Vector3d>>
      directions;  // unit vectors to the cameras of earlier frames in which the object was visible
  for (const files::PosedFrame& frame : files::MappedFrames(sequence, trajectory)) {
    if (first.size() == objects.size()) break;
    const std::map<int, Region> regions = MaskRegions(sequence, frame.index);
    for (const MapObject& entry : objects) {
      if (first.contains(entry.object.id)) continue;
      const auto outline = CuboidOutline(entry.object.cuboid, sequence.camera(), frame.T_world_camera);
      if (!outline) continue;
      const bool visible = std::any_of(regions.begin(), regions.end(),
                                       [&](const auto& region) { return Fits(region.second, *outline); });
      if (!visible) continue;
      const Eigen::Vector3d direction =
          (frame.T_world_camera.translation() - entry.object.cuboid.T_world_object.translation()).normalized();
      std::vector<Eigen::Vector3d>& earlier = directions[entry.object.id];
      const bool parallax = std::any_of(earlier.begin(), earlier.end(), [&](const Eigen::Vector3d& other) {
        return direction.dot(other) < std::cos(kTrackableParallax_rad);
      });
      if (parallax) first[entry.object.id] = frame.index;
      earlier.push_back(direction);
    }
  }
  return first;
}

}  // namespace romap::cli
