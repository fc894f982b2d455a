#include "server/slam/motion_model.h"

#include <Eigen/Geometry>

#include "common/angles.h"
#include "server/slam/optimize/lie.h"

namespace romap::slam {
namespace {

constexpr double kMaxPrediction_s = 0.25;
// Between frames 40 ms apart, 20 m/s^2 change the position by 3 cm, and 3000 deg/s^2 the orientation by 5 deg.
constexpr double kMaxSurpriseShare = 0.1;  // of the scene's depth
constexpr double kMaxSurprise_rad = 8 * kRadPerDeg;

// `motion`: T_previous_last, during `duration_s`.
ReadoutMotion DuringReadout(const SE3<Camera, Camera>& motion, double duration_s, double readout_s) {
  const double share = readout_s / duration_s;
  return {.rotation_rad = share * LogRotation(motion.rotation()), .translation_mu = share * motion.translation()};
}

}  // namespace

void MotionModel::Reset() {
  last_pose_.reset();
  motion_.reset();
}

void MotionModel::Update(const SE3<World, Camera>& T_world_camera, const std::optional<SE3<World, Camera>>& prior,
                         int64_t timestamp_ns, bool is_continuous) {
  motion_.reset();
  if (last_pose_ && is_continuous) {
    motion_ = last_pose_->Inverse() * T_world_camera;
    motion_duration_s_ = 1e-9 * static_cast<double>(timestamp_ns - last_timestamp_ns_);
  }
  last_pose_ = T_world_camera;
  last_prior_ = prior;
  last_timestamp_ns_ = timestamp_ns;
}

void MotionModel::Correct(const ScaledPose& before, const ScaledPose& after) {
  if (!last_pose_) return;
  const double scale = after.scale / before.scale;
  const SE3<Camera, Camera> T_reference_last = before.T_world_camera.Inverse() * *last_pose_;
  last_pose_ = ScaledPose{after.T_world_camera, scale}.Compose(T_reference_last);
  if (motion_) motion_ = ScaleTranslation(*motion_, scale);
}

SE3<World, Camera> MotionModel::Predict(const Frame& frame, bool use_prior) const {
  if (use_prior && frame.T_world_camera && last_prior_) {
    return *last_pose_ * (last_prior_->Inverse() * *frame.T_world_camera);
  }
  if (!motion_ || motion_duration_s_ <= 0) return *last_pose_;
  const double gap_s = 1e-9 * static_cast<double>(frame.timestamp_ns - last_timestamp_ns_);
  if (gap_s > kMaxPrediction_s) return *last_pose_;
  const double share = gap_s / motion_duration_s_;
  const Eigen::AngleAxisd turn(motion_->rotation());
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(share * turn.angle(), turn.axis()));
  return *last_pose_ * SE3<Camera, Camera>(rotation, share * motion_->translation());
}

std::optional<ReadoutMotion> MotionModel::PredictReadout(double readout_s, int64_t timestamp_ns) const {
  const double gap_s = 1e-9 * static_cast<double>(timestamp_ns - last_timestamp_ns_);
  if (!motion_ || motion_duration_s_ <= 0 || gap_s > kMaxPrediction_s) return std::nullopt;
  return DuringReadout(*motion_, motion_duration_s_, readout_s);
}

// The mean velocity since the last pose belongs to the middle of the interval. The frame's own velocity is extrapolated
// from that and from the mean velocity of the interval before.
std::optional<ReadoutMotion> MotionModel::ReadoutTo(const SE3<World, Camera>& T_world_camera, double readout_s,
                                                    int64_t timestamp_ns) const {
  const double gap_s = 1e-9 * static_cast<double>(timestamp_ns - last_timestamp_ns_);
  if (!last_pose_ || gap_s <= 0 || gap_s > kMaxPrediction_s) return std::nullopt;
  ReadoutMotion motion = DuringReadout(last_pose_->Inverse() * T_world_camera, gap_s, readout_s);
  if (!motion_ || motion_duration_s_ <= 0 || motion_duration_s_ > kMaxPrediction_s) return motion;
  const ReadoutMotion before = DuringReadout(*motion_, motion_duration_s_, readout_s);
  const double share = gap_s / (gap_s + motion_duration_s_);
  motion.rotation_rad += share * (motion.rotation_rad - before.rotation_rad);
  motion.translation_mu += share * (motion.translation_mu - before.translation_mu);
  return motion;
}

bool IsPlausible(const SE3<World, Camera>& predicted, const SE3<World, Camera>& pose, double depth_mu) {
  return (predicted.translation() - pose.translation()).norm() <= kMaxSurpriseShare * depth_mu &&
         predicted.rotation().angularDistance(pose.rotation()) <= kMaxSurprise_rad;
}

}  // namespace romap::slam
