// The part of ObjectField that watches what training makes of its views, and says what is wrong with them.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <vector>

#include "server/nerf/depth_check.h"
#include "server/nerf/object_field.h"

namespace romap {
namespace {

constexpr double kLeastShareInBox = 0.5;  // of the rays through an object's masks

}  // namespace

nerf::RenderSpace ObjectField::Space() const {
  const Eigen::Vector3f extent = box_.ExtentUnit();
  return {occupancy_.bits(), {extent.x(), extent.y(), extent.z()}, box_.GridPose()};
}

// Votes of views that are left out go, those of views that are forgiven come back.
void ObjectField::RebuildHull() {
  hull_.Reset(box_, depths_fit_);
  for (size_t i = 0; i < views_.size(); ++i) {
    if (trust_.trusted(i)) hull_.Add(views_[i]);
  }
  occupancy_.SetHull(hull_.Carve());
}

void ObjectField::JudgeDepths() {
  const bool fit = DepthsFit(views_);
  if (fit == depths_fit_) return;
  depths_fit_ = fit;
  RebuildHull();
}

void ObjectField::WeighRays() { rays_.Weigh(trust_.Weights(), need_); }

void ObjectField::Look() {
  const ProbeReport report = probe_.Look(trainer_->model(), config_, Space());
  gain_.Record(steps(), report.Loss(trust_.Weights()));
  if (trust_.Judge(report, steps())) {
    RebuildHull();
    plan_.OnNewView(steps());
  }
  float sum = 0;
  int n = 0;
  for (float t : report.tiles) sum += t, n += t > 0;
  for (size_t i = 0; i < need_.size(); ++i) {
    const float r = static_cast<float>(config_.need_floor) +
                    (1 - static_cast<float>(config_.need_floor)) * std::min(4.0f, report.tiles[i] * n / sum);
    need_[i] = 0.5f * (need_[i] + r);
    if (i % PixelSampler::kTiles == PixelSampler::kBorderTile) need_[i] = static_cast<float>(config_.border_weight);
  }
  WeighRays();
  plan_.OnFulfilled(steps(), gain_.FallPer100Steps());
}

std::string ObjectField::Concern() const {
  std::vector<std::string> concerns;
  if (!CanTrain()) concerns.push_back("training diverged again and again, and rests until something new is told of it");
  if (!box_fault_.empty()) concerns.push_back(box_fault_);
  if (refused_views_ > 0) {
    concerns.push_back(fmt::format("{} views were refused, the last: {}", refused_views_, view_fault_));
  }
  if (black_views_ > 0) concerns.push_back(fmt::format("it is black in {} of its {} views", black_views_, views()));
  if (!depths_fit_) concerns.push_back("its depth images do not agree with its masks, and are not used");
  if (share_in_box_ < kLeastShareInBox) concerns.push_back("its box misses most of what its masks show");
  std::vector<std::string> odd;
  for (size_t i = 0; i < views_.size(); ++i) {
    if (!trust_.trusted(i)) odd.push_back(views_[i].keyframe.ToString());
  }
  if (!odd.empty()) {
    concerns.push_back(
        fmt::format("what it looks like in {} contradicts its other views, and is left out", fmt::join(odd, ", ")));
  }
  return fmt::format("{}", fmt::join(concerns, "; "));
}

}  // namespace romap
