#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace romap::slam {

// Where a pixel lies relative to the instance masks of its image.
enum class MaskZone : uint8_t {
  kUnknown,  // no detector ran on the image
  kFar,      // outside of all masks, close to none
  kNear,     // outside of all masks, but close to one
  kBorder,   // too close to a mask's border to tell, because masks are inaccurate there
  kInside,
};

// Classifies pixels of one mask image.
class MaskZones {
 public:
  // `labels`: CV_16UC1, 0 = nothing. Empty: no detector ran. Must not change while this exists.
  explicit MaskZones(const cv::Mat& labels);
  // The zone of a feature `octave_scale` px wide, to which the masks give `label` (see LabelAt).
  MaskZone At(const Eigen::Vector2f& pixel_px, double octave_scale, uint16_t label) const;

 private:
  cv::Mat labels_;
  cv::Mat around_;  // CV_8UC1, shrunk: not 0 in and around masks
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
