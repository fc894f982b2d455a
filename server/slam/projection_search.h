#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/frame_features.h"
#include "server/slam/local_map.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Parameters of the search for known points around their projections.
struct ProjectionSearch {
  double radius_px = 4;   // multiplied by the predicted octave scale, clamped to 1..3
  int max_distance = 60;  // Hamming, bits
  double ratio = 0.9;     // best over second best distance; candidates at the same spot do not count
  // Between the ray and the mean ray of the point. ORB descriptors differ too much at larger angles.
  double min_view_cosine = 0.7;
};

// The feature that matches a point.
struct FoundFeature {
  int feature = 0;
  int distance = 0;  // Hamming, bits
};

struct PointMatch {
  int point = 0;    // index
  int feature = 0;  // index
  int distance = 0;
};

// Finds points in one frame with a known pose. Reuses its buffers; not thread-safe.
class ProjectionMatcher {
 public:
  ProjectionMatcher(const FrameFeatures& frame, const SE3<World, Camera>& T_world_camera);

  // Predicted pixel and octave scale of a point; nullopt: behind the camera, outside the image, or viewed from a
  // direction that differs too much from LocalPoint::direction_world.
  struct Prediction {
    Eigen::Vector2d pixel_px;
    double octave_scale = 1;
  };
  std::optional<Prediction> Predict(const LocalPoint& point, double min_view_cosine) const;

  // The feature that matches the point. Features with a non-zero entry in `taken` (empty: none) are ignored.
  std::optional<FoundFeature> Find(const LocalPoint& point, const ProjectionSearch& search,
                                   std::span<const uint8_t> taken);

  // One-to-one matches: of two points with the same feature, the one with the smaller descriptor distance gets it.
  std::vector<PointMatch> MatchAll(std::span<const LocalPoint> points, const ProjectionSearch& search,
                                   std::span<const uint8_t> taken);

 private:
  const FrameFeatures& frame_;
  const SE3<Camera, World> T_camera_world_;
  const Eigen::Vector3d center_world_;
  std::vector<int> near_;
};

// Matches by descriptors alone: mutually best, and clearly better than the second best.
std::vector<PointMatch> MatchByDescriptors(std::span<const LocalPoint> points, const FrameFeatures& frame,
                                           int max_distance, double ratio);

}  // namespace romap::slam
