#include "server/slam/merge_trial.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/slam/map_adjustment.h"

namespace romap::slam {
namespace {

constexpr size_t kMinSharedMapPoints = 25;
// Share of the merged points that must keep their observations from both maps.
constexpr double kMinAgreeingShare = 0.8;
// Each of the maps was adjusted to its own observations alone. Together they fit slightly worse.
constexpr double kMaxOutlierRiseByMerge = 0.03;
constexpr double kMaxRmsRatioByMerge = 1.25;

}  // namespace

bool MergeTrial::Start(const MapJoint& joint, const SlamMap& from, const SlamMap& into) {
  Cancel();
  moved_.clear();
  for (const auto& [id, keyframe] : from.keyframes()) moved_.insert(id);
  SlamMap moved = from;
  moved.Transform(joint.S_into_from);
  merged_.emplace(into);
  merged_->Append(std::move(moved));
  before_ = MeasureFit(GlobalProblem(*merged_, config_, /*find_lens=*/false).bundle);
  ConnectParts(joint, config_, *merged_);
  shared_before_ = CountSharedPoints();
  if (shared_before_ < kMinSharedMapPoints) {
    merged_.reset();
    return false;
  }
  adjuster_.Start(*merged_, /*find_lens=*/false);
  return true;
}

void MergeTrial::Cancel() {
  adjuster_.Cancel();
  merged_.reset();
}

size_t MergeTrial::CountSharedPoints() const {
  return static_cast<size_t>(std::count_if(merged_->points().begin(), merged_->points().end(), [&](const auto& entry) {
    const auto& observations = entry.second.observations;
    const auto moved = std::count_if(observations.begin(), observations.end(),
                                     [&](const FeatureRef& ref) { return moved_.contains(ref.keyframe); });
    return moved > 0 && static_cast<size_t>(moved) < observations.size();
  }));
}

std::optional<bool> MergeTrial::Conclude(bool wait) {
  if (!wait && !adjuster_.IsFinished()) return std::nullopt;
  const std::optional<BundleFit> after = adjuster_.Fit(wait);
  adjuster_.Apply(/*wait=*/true, *merged_);  // removes the outliers
  const size_t shared = CountSharedPoints();
  merged_.reset();
  const bool confirmed = after && shared >= kMinSharedMapPoints &&
                         static_cast<double>(shared) >= kMinAgreeingShare * static_cast<double>(shared_before_) &&
                         after->OutlierShare() <= before_.OutlierShare() + kMaxOutlierRiseByMerge &&
                         after->rms_px <= kMaxRmsRatioByMerge * before_.rms_px;
  spdlog::info(
      "slam: merge {}: {} of {} common points agree with both maps; outliers {:.2f} -> {:.2f} %, reprojection error "
      "{:.3f} -> {:.3f} px",
      confirmed ? "confirmed" : "rejected", shared, shared_before_, 100 * before_.OutlierShare(),
      after ? 100 * after->OutlierShare() : 100.0, before_.rms_px, after ? after->rms_px : 0.0);
  return confirmed;
}

}  // namespace romap::slam
