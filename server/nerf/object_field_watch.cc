// The part of ObjectField that watches what training makes of its views, and says what is wrong with them.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <vector>

#include "server/nerf/depth_check.h"
#include "server/nerf/object_field.h"

namespace romap::nerf {
namespace {

constexpr double kLeastVoteShift = 0.01;  // of the box's side, two thirds of a hull's cell: views so far off vote anew
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
    if (trust_.trusted(i)) VoteOnHull(i);
  }
  occupancy_.SetHull(hull_.Carve());
}

void ObjectField::VoteOnHull(size_t view) {
  voted_.resize(views_.size());
  voted_[view] = views_[view].T_world_camera;
  hull_.Add(views_[view]);
}

void ObjectField::WithdrawVote(size_t view) {
  ObjectView as_voted = views_[view];
  as_voted.T_world_camera = voted_[view];
  hull_.Remove(as_voted);
}

void ObjectField::JudgeDepths() {
  const bool fit = DepthsFit(views_);
  if (fit == depths_fit_) return;
  depths_fit_ = fit;
  RebuildHull();
}

void ObjectField::RefinePoses() {
  if (!refiner_.IsDue(views_.size(), steps())) return;
  refiner_.Refine(views_, trust_.Weights(), box_, rays_, trainer_->model(), Space(), steps());
  rays_.SetCameras(views_, box_);
  probe_.Build(rays_, views_.size());
  bool voted_anew = false;
  for (size_t i = 0; i < views_.size(); ++i) {
    if (!trust_.trusted(i) || ShiftShare(voted_[i], views_[i].T_world_camera) < kLeastVoteShift) continue;
    WithdrawVote(i);
    VoteOnHull(i);
    voted_anew = true;
  }
  if (voted_anew) occupancy_.SetHull(hull_.Carve());
}

void ObjectField::Look() {
  RefinePoses();
  const ProbeReport report = probe_.Look(trainer_->model(), config_, Space());
  if (trust_.Judge(report, steps())) {
    RebuildHull();
    plan_.OnNewView(steps());
    gain_.Restart();
  }
  gain_.Record(steps(), report.Loss(trust_.Weights()));
  rays_.Weigh(trust_.Weights());
  plan_.OnFulfilled(steps(), gain_.FallPer100Steps());
}

std::string ObjectField::Concern() const {
  std::vector<std::string> concerns;
  if (!CanTrain()) concerns.push_back("training diverged again and again, and rests until something new is told of it");
  if (motion_refused_) concerns.push_back("a correction of the map that is no motion was passed over");
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

}  // namespace romap::nerf
