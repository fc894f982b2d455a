#include "server/nerf/field_warnings.h"

#include <fmt/format.h>

#include "common/status.h"

namespace romap::nerf {
namespace {

constexpr double kMinShareIntersectingBox = 0.5;
// Shapes are hardly worse than with exact masks up to this width.
constexpr int kMaxPreciseBorder_px = 3;

}  // namespace

void FieldWarnings::OnBox(const absl::Status& status) { box_error_ = Message(status); }

void FieldWarnings::OnRejectedView(const absl::Status& status) {
  ++rejected_views_;
  view_error_ = Message(status);
}

std::string FieldWarnings::Text(int divergences, const std::vector<KeyframeId>& untrusted) const {
  std::vector<std::string> warnings;
  if (divergences > 0) {
    warnings.push_back(fmt::format("training diverged {} times; paused until new data arrives", divergences));
  }
  if (invalid_correction_) warnings.push_back("a map correction with values that are not finite was ignored");
  if (!box_error_.empty()) warnings.push_back(box_error_);
  if (rejected_views_ > 0) {
    warnings.push_back(fmt::format("{} views rejected; last error: {}", rejected_views_, view_error_));
  }
  if (checks_.black_views > 0) {
    warnings.push_back(fmt::format("the object is black in {} of {} views", checks_.black_views, checks_.views));
  }
  if (checks_.mask_border_px > kMaxPreciseBorder_px) {
    warnings.push_back(
        fmt::format("the masks are imprecise: their borders are uncertain by {} px", checks_.mask_border_px));
  }
  if (!checks_.depth_consistent) warnings.push_back("depth images ignored because they contradict the masks");
  if (checks_.share_intersecting_box < kMinShareIntersectingBox) {
    warnings.push_back("most rays through the masks miss the object's box");
  }
  if (!untrusted.empty()) {
    std::vector<std::string> names;
    for (const KeyframeId keyframe : untrusted) names.push_back(keyframe.ToString());
    warnings.push_back(fmt::format("views excluded because they contradict the others: {}", fmt::join(names, ", ")));
  }
  return fmt::format("{}", fmt::join(warnings, "; "));
}

}  // namespace romap::nerf
