#include "server/nerf/boxed_field.h"

#include <algorithm>
#include <utility>

#include "server/nerf/hull_distance.h"
#include "server/nerf/math/random.h"

namespace romap::nerf {
namespace {

// Limits of a transfer to another box. Beyond them, a transfer is no cheaper than training from scratch.
constexpr double kMaxUnknownShare = 0.8;  // of the new box, outside the old one
constexpr double kMinFeatureScale = 0.25;
constexpr double kMaxGrowth = 2.5;  // of the longest side since the hash grid was laid out

}  // namespace

BoxedField::BoxedField(const NerfConfig& config, uint64_t seed)
    : config_(config), seed_(seed), occupancy_(config_), trainer_(MakeTrainer(config_, seed)) {}

BoxedField::Fit BoxedField::FitTo(const Cuboid& cuboid) {
  if (!has_box_) {
    box_ = TrainingBox::Around(cuboid, config_.box_enlargement);
    has_box_ = true;
    return {BoxChange::kFirst};
  }
  if (box_.StillFits(cuboid)) return {};
  const Fit fit = TransferTo(box_.Refitted(cuboid, config_.box_enlargement));
  if (fit.change == BoxChange::kRestarted) {
    box_ = TrainingBox::Around(cuboid, config_.box_enlargement);
    Restart();
  }
  return fit;
}

// Returns kRestarted, without any change, if the boxes overlap too little.
BoxedField::Fit BoxedField::TransferTo(const TrainingBox& box) {
  const double unknown_share = 1 - box_.ShareCovered(box);
  const double growth = box.LongestSide_mu() / box.unit_mu;
  if (unknown_share > kMaxUnknownShare || growth > kMaxGrowth || growth < 1 / kMaxGrowth) {
    return {BoxChange::kRestarted};
  }
  occupancy_.MoveTo(box_.ShareOf(box).cast<float>());
  // In a box that was too small, the field learned the outside as texture on the walls of the box. Smaller features let
  // training remove it. The limit holds over all boxes together, because output weights that outgrow their features
  // make training diverge.
  const double scale = std::max(kMinFeatureScale, feature_scale_ * (1 - 3 * unknown_share));
  trainer_->ShrinkFeatures(static_cast<float>(scale / feature_scale_));
  feature_scale_ = scale;
  box_ = box;
  return {BoxChange::kTransferred, unknown_share};
}

void BoxedField::Restart() {
  ++restarts_;
  trainer_ = MakeTrainer(config_, RandomBits(seed_, 5, restarts_));
  occupancy_.Reset();
  feature_scale_ = 1;
}

RenderSpace BoxedField::Space() const {
  const Eigen::Vector3f extent = box_.ExtentUnit();
  return {occupancy_.bits(), {extent.x(), extent.y(), extent.z()}, box_.GridPose()};
}

TrainStats BoxedField::Run(StepSource source, int steps, int threads) {
  const RenderSpace space = Space();
  source.extent = space.extent;
  source.grid = space.grid;
  if (model().IsDistance() && trainer_->steps_done() == 0) {
    trainer_->FitDistances(source, DistanceToBorder(occupancy_.hull(), box_.ExtentUnit()));
  }
  return trainer_->Run(source, occupancy_, steps, std::clamp(threads, 1, 64));
}

}  // namespace romap::nerf
