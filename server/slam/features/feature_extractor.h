#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/features/corner_detector.h"
#include "server/slam/features/feature.h"
#include "server/slam/features/image_pyramid.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Finds oriented FAST corners with steered BRIEF descriptors (ORB: Rublee et al., ICCV 2011). The same frame gives the
// same features in the same order. An image that is too small or has no texture gives no features. Not thread-safe.
// Keeps its buffers and the pyramid of the last frame between calls; the image of that frame must not be modified in
// between.
//
// If the frame has its image before undistortion (Frame::source_gray), corners are found and described there and only
// their positions are undistorted, because a resampled image is less sharp.
class FeatureExtractor {
 public:
  explicit FeatureExtractor(const SlamConfig& config) : config_(config) {}

  // At most SlamConfig::scene_features, spread evenly over the image at every octave.
  std::vector<Feature> ExtractScene(const Frame& frame);

  // At most SlamConfig::object_features additional features inside the instance masks. Accepts weaker corners, because
  // objects are small and have little texture. `existing`: the scene features of the same frame, which are not
  // repeated.
  std::vector<Feature> ExtractObjects(const Frame& frame, const std::vector<Feature>& existing);

  // Both, scene features first.
  std::vector<Feature> Extract(const Frame& frame);

 private:
  // A corner without a descriptor.
  struct Candidate {
    cv::Point2f corner_px;  // in the octave's image
    int octave = 0;
    Eigen::Vector2f pixel_px;  // in the pinhole image
  };

  // Finds at most `count` corners of an octave.
  using FindCorners = std::function<Corners(int octave, size_t count)>;

  void Prepare(const Frame& frame);
  // The corners inside the pinhole image at pixels where `free` (CV_8UC1, size of the pinhole image; empty =
  // everywhere) is nonzero.
  Corners KeepVisible(const Frame& frame, int octave, const Corners& corners, const cv::Mat& free) const;
  // NaN or outside the image if the corner is not visible to the pinhole camera.
  std::vector<Eigen::Vector2f> PinholePixels(const Frame& frame, int octave, const Corners& corners) const;
  std::vector<Candidate> FindInOctaves(const Frame& frame, int count, const FindCorners& find) const;
  std::vector<Feature> Describe(const Frame& frame, const std::vector<Candidate>& candidates);

  const SlamConfig config_;
  cv::Mat gray_;
  cv::Mat image_;  // of the pyramid; kept so that its memory is not reused for another image
  uint64_t image_frame_id_ = 0;
  ImagePyramid pyramid_;
};

}  // namespace romap::slam
