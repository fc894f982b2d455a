#include "server/slam/rejected_pairs.h"

#include <algorithm>
#include <cstdint>

namespace romap::slam {
namespace {

constexpr uint64_t kRejectedRadius_keyframes = 15;

bool IsNear(KeyframeId a, KeyframeId b) {
  return std::max(a.value, b.value) - std::min(a.value, b.value) <= kRejectedRadius_keyframes;
}

}  // namespace

bool RejectedPairs::Contains(KeyframeId newest, KeyframeId old) const {
  return std::any_of(pairs_.begin(), pairs_.end(),
                     [&](const auto& pair) { return IsNear(pair.first, newest) && IsNear(pair.second, old); });
}

}  // namespace romap::slam
