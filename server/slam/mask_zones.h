#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace romap::slam {

// How a place of a picture lies to the picture's instance masks.
enum class MaskZone : uint8_t {
  kUnknown,  // no detector ran on the picture
  kFar,      // outside of all masks, close to none
  kNear,     // outside of all masks, but close to one
  kBorder,   // so close to a mask's border that the mask, which errs there, does not tell
  kInside,
};

// Tells where places lie in one mask image.
class MaskZones {
 public:
  // `labels`: CV_16UC1, 0 = nothing. Empty: no detector ran. Not written to meanwhile.
  explicit MaskZones(const cv::Mat& labels);
  // Of what is `octave_scale` px wide at a pixel of the image, to which the masks give `label` (see LabelAt).
  MaskZone At(const Eigen::Vector2f& pixel_px, double octave_scale, uint16_t label) const;

 private:
  cv::Mat labels_;
  cv::Mat around_;  // CV_8UC1, shrunk: not 0 in and around masks
};

// What several pictures say of one point.
struct MaskVotes {
  int inside = 0;
  int border = 0;
  int near = 0;
  int far = 0;

  int total() const { return inside + border + near + far; }
  void Add(MaskZone place);
  void Add(const MaskVotes& other);
};

}  // namespace romap::slam
