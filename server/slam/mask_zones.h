#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace romap::slam {

// Where a pixel lies relative to the instance masks of its image.
enum class MaskZone : uint8_t {
  kUnknown,  // no detector ran on the image
  kFar,      // outside of all masks and not close to one
  kNear,     // outside of all masks, but close to one
  kBorder,   // close to the border of a mask, where masks are inaccurate
  kInside,
};

// Classifies pixels of one mask image.
class MaskZones {
 public:
  // `labels`: CV_16UC1, 0 = background. Empty: no detector ran. Must not change while this exists.
  explicit MaskZones(const cv::Mat& labels);
  // The zone of a feature with a width of `octave_scale` px. `label`: the feature's label from the masks (see LabelAt).
  MaskZone At(const Eigen::Vector2f& pixel_px, double octave_scale, uint16_t label) const;

 private:
  cv::Mat labels_;
  cv::Mat around_;  // CV_8UC1, downscaled: nonzero in and around masks
};

// Counts of the zones of one point in several images.
struct MaskVotes {
  int inside = 0;
  int border = 0;
  int near = 0;
  int far = 0;

  int total() const { return inside + border + near + far; }
  void Add(MaskZone zone);
  void Add(const MaskVotes& other);
};

}  // namespace romap::slam
