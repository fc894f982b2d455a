#pragma once

#include <utility>
#include <vector>

#include "common/ids.h"

namespace romap::slam {

// Pairs of keyframes that turned out to show different places although they look alike. Keyframes close to them show
// the same two places, so they are not compared again either.
class RejectedPairs {
 public:
  void Add(KeyframeId newest, KeyframeId old) { pairs_.emplace_back(newest, old); }
  bool Contains(KeyframeId newest, KeyframeId old) const;

 private:
  std::vector<std::pair<KeyframeId, KeyframeId>> pairs_;
};

}  // namespace romap::slam
