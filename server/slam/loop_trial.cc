#include "server/slam/loop_trial.h"

#include <spdlog/spdlog.h>

#include "server/slam/loop_closer.h"
#include "server/slam/map_adjustment.h"

namespace romap::slam {
namespace {

// By how much the share of outliers may rise: the points that the loop merges bring new constraints, and a few of them
// are wrong even if the loop is right.
constexpr double kMaxOutlierRise = 0.01;
constexpr double kMaxRmsRatio = 1.05;

}  // namespace

void LoopTrial::Start(const SlamMap& map, const LoopMatch& loop, bool scale_is_known, bool find_lens) {
  Cancel();
  loop_ = loop;
  scale_is_known_ = scale_is_known;
  before_ = MeasureFit(GlobalProblem(map, config_, /*find_lens=*/false).bundle);
  SlamMap trial = map;
  CloseLoop(*loop_, scale_is_known_, config_, trial);
  adjuster_.Start(trial, find_lens);
}

void LoopTrial::Cancel() {
  adjuster_.Cancel();
  loop_.reset();
}

LoopTrial::Verdict LoopTrial::Conclude(bool wait, SlamMap& map) {
  if (!wait && !adjuster_.IsFinished()) return Verdict::kPending;
  const std::optional<BundleFit> after = adjuster_.Fit(wait);
  const bool fits = after && after->OutlierShare() <= before_.OutlierShare() + kMaxOutlierRise &&
                    after->rms_px <= kMaxRmsRatio * before_.rms_px;
  spdlog::info("slam: loop {} to {} {}: outliers {:.2f} -> {:.2f} %, reprojection error {:.3f} -> {:.3f} px",
               loop_->newest.ToString(), loop_->old.ToString(), fits ? "confirmed by the map" : "contradicts the map",
               100 * before_.OutlierShare(), after ? 100 * after->OutlierShare() : 100.0, before_.rms_px,
               after ? after->rms_px : 0.0);
  const bool is_known = map.FindKeyframe(loop_->newest) != nullptr && map.FindKeyframe(loop_->old) != nullptr;
  if (!fits || !is_known || !CloseLoop(*loop_, scale_is_known_, config_, map)) {
    adjuster_.Cancel();
    return Verdict::kRejected;
  }
  adjuster_.Apply(/*wait=*/true, map);
  return Verdict::kClosed;
}

}  // namespace romap::slam
