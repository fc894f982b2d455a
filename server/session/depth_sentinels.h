#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "common/diagnostic.h"

namespace romap::session {

// Finds depth values that stand for "unknown" instead of a distance: 65535, and any value at which the sensor saturates
// or that it writes where it measures nothing. Such a value is the largest or the smallest one of the image, many
// pixels have it, and hardly any have a value close to it; on a real surface, even on one parallel to the image, the
// noise and the slope of the surface spread the values.
class DepthSentinels {
 public:
  // Sets the depth of pixels with such values to 0 in place. `depth_mu`: CV_32FC1, whole multiples of `scale_mu`, 0 =
  // unknown; may be empty.
  void Remove(uint64_t frame_id, double scale_mu, cv::Mat* depth_mu);

  // What was removed. nullopt: nothing.
  const std::optional<Diagnostic>& diagnostic() const { return diagnostic_; }
  // depth_empty: many depth images have no pixel with depth. nullopt: they have.
  std::optional<Diagnostic> CheckEmpty() const;

 private:
  std::optional<Diagnostic> diagnostic_;
  uint64_t images_ = 0, empty_ = 0;
  uint64_t first_empty_ = 0;  // frame
};

}  // namespace romap::session
