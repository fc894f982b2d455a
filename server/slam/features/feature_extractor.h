#pragma once

#include <vector>

#include "common/messages.h"
#include "server/slam/features/feature.h"
#include "server/slam/slam_config.h"

namespace romap {

// Finds ORB features: some spread evenly over the image, and further ones inside the instance masks, where weaker
// corners are welcome because objects are small and have little texture.
class FeatureExtractor {
 public:
  explicit FeatureExtractor(const SlamConfig& config) : config_(config) {}

  // The same frame gives the same features in the same order. None for an image that is too small or has no texture.
  std::vector<Feature> Extract(const Frame& frame) const;

 private:
  const SlamConfig config_;
};

}  // namespace romap
