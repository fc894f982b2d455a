#include "server/session/depth_sentinels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

namespace romap::session {
namespace {

constexpr int kSaturated = 65535;
constexpr double kMinShare = 0.01;       // of the pixels with depth
constexpr double kMaxShare = 0.9;        // a scene that is one plane parallel to the image
constexpr double kNearShare = 0.005;     // of the value: what is close to it
constexpr int kMinNear = 3;              // units
constexpr double kMaxNearPixels = 0.02;  // pixels with values close to it, per pixel with the value

constexpr uint64_t kMinEmpty = 5;  // images; a sensor may lose a few
constexpr double kMinEmptyShare = 0.2;

// Whether many pixels have this value and hardly any have one close to it.
bool IsIsolated(const std::vector<int>& counts, int value, int total) {
  const int count = counts[static_cast<size_t>(value)];
  if (count < kMinShare * total || count > kMaxShare * total) return false;
  const int reach = std::max(kMinNear, static_cast<int>(std::lround(kNearShare * value)));
  int near = 0;
  for (int other = std::max(1, value - reach); other <= std::min(kSaturated, value + reach); ++other) {
    if (other != value) near += counts[static_cast<size_t>(other)];
  }
  return near <= kMaxNearPixels * count;
}

}  // namespace

void DepthSentinels::Remove(uint64_t frame_id, double scale_mu, cv::Mat* depth_mu) {
  if (depth_mu->empty()) return;
  const auto to_units = [&](float depth) {
    return std::clamp(static_cast<int>(std::lround(depth / scale_mu)), 0, kSaturated);
  };
  std::vector<int> counts(kSaturated + 1, 0);
  for (int v = 0; v < depth_mu->rows; ++v) {
    const auto* row = depth_mu->ptr<float>(v);
    for (int u = 0; u < depth_mu->cols; ++u) ++counts[static_cast<size_t>(to_units(row[u]))];
  }
  const int total = depth_mu->rows * depth_mu->cols - counts[0];
  ++images_;
  if (total == 0 && empty_++ == 0) first_empty_ = frame_id;
  int sentinel = counts[kSaturated] > 0 ? kSaturated : 0;
  if (sentinel == 0) {
    const auto has_pixels = [](int count) { return count > 0; };
    const int lowest = static_cast<int>(std::find_if(counts.begin() + 1, counts.end(), has_pixels) - counts.begin());
    const int highest =
        kSaturated - static_cast<int>(std::find_if(counts.rbegin(), counts.rend(), has_pixels) - counts.rbegin());
    for (const int value : {highest, lowest}) {
      if (value > 0 && value < kSaturated && sentinel == 0 && IsIsolated(counts, value, total)) sentinel = value;
    }
  }
  if (sentinel == 0) return;
  for (int v = 0; v < depth_mu->rows; ++v) {
    auto* row = depth_mu->ptr<float>(v);
    for (int u = 0; u < depth_mu->cols; ++u) {
      if (to_units(row[u]) == sentinel) row[u] = 0;
    }
  }
  const double share = static_cast<double>(counts[static_cast<size_t>(sentinel)]) / total;
  if (!diagnostic_) {
    diagnostic_ = Diagnostic{
        .code = "depth_value_ignored",
        .severity = Severity::kInfo,
        .first_frame_id = frame_id,
        .text = fmt::format("the depth value {} ({:.3g} map units) is read as \"unknown\": {:.0f} % of the pixels of "
                            "frame {} have it, and hardly any have one close to it",
                            sentinel, sentinel * scale_mu, 100 * share, frame_id),
        .advice = "write 0 where there is no depth"};
  } else {
    ++diagnostic_->count;
  }
}

std::optional<Diagnostic> DepthSentinels::CheckEmpty() const {
  if (empty_ < kMinEmpty || static_cast<double>(empty_) < kMinEmptyShare * static_cast<double>(images_)) {
    return std::nullopt;
  }
  return Diagnostic{
      .code = "depth_empty",
      .severity = Severity::kWarning,
      .first_frame_id = first_empty_,
      .count = empty_,
      .text = fmt::format("{} of {} depth images have no pixel with depth, so they do not help", empty_, images_),
      .advice = "check the depth sensor and the conversion of its images"};
}

}  // namespace romap::session
