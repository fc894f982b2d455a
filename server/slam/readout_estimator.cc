#include "server/slam/readout_estimator.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "server/slam/geometry/reprojection.h"
#include "server/slam/optimize/lie.h"

namespace romap::slam {
namespace {

constexpr size_t kMinObservations = 30;
constexpr int kFramesPerBlock = 15;
constexpr size_t kMinBlocks = 5;
constexpr size_t kMaxBlocks = 400;  // 3 min at 30 frames/s; more would not change the estimate
// A frame whose image moves less contributes nothing but systematic errors.
constexpr double kMinMotion_px_per_s = 100;

}  // namespace

void ReadoutEstimator::AddFrame(const CameraModel& camera, const SE3<World, Camera>& T_world_camera,
                                std::span<const Observation> observations, const ReadoutMotion& motion) {
  if (observations.size() < kMinObservations) return;
  if (blocks_.size() == kMaxBlocks && blocks_.back().frames == kFramesPerBlock) return;
  const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
  const CameraFromWorld pose{T_camera_world.RotationMatrix(), T_camera_world.translation()};
  // Least squares of | pixel + by_readout * x - projection - by_pose * d |, over the readout error x and the pose d.
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> coupling = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> pose_side = Eigen::Matrix<double, 6, 1>::Zero();
  double readout_information = 0, readout_side = 0, motion_px_per_s = 0;
  for (const Observation& observed : observations) {
    const PoseObservation& observation = observed.observation;
    const Eigen::Vector3d p = pose.rotation * observation.p_world + pose.translation;
    if (!(p.z() > 0)) continue;
    Eigen::Matrix<double, 2, 3> projection;
    projection << camera.fx_px / p.z(), 0, -camera.fx_px * p.x() / (p.z() * p.z()),  //
        0, camera.fy_px / p.z(), -camera.fy_px * p.y() / (p.z() * p.z());
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose << projection, -projection * Hat(p);
    const Eigen::Vector2d flow_px = projection * (motion.rotation_rad.cross(p) + motion.translation_mu);
    const Eigen::Vector2d by_readout = observed.read_at * flow_px;
    const Eigen::Vector2d error_px = observation.pixel_px - camera.Project(p);
    const double weight = 1 / (observation.sigma_px * observation.sigma_px);
    H += weight * by_pose.transpose() * by_pose;
    coupling += weight * by_pose.transpose() * by_readout;
    pose_side += weight * by_pose.transpose() * error_px;
    readout_information += weight * by_readout.squaredNorm();
    readout_side -= weight * by_readout.dot(error_px);
    motion_px_per_s += flow_px.norm() / static_cast<double>(observations.size());
  }
  if (motion_px_per_s < kMinMotion_px_per_s) return;
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(H);
  const Eigen::Matrix<double, 6, 1> absorbed = solver.solve(coupling);
  const double information = readout_information - coupling.dot(absorbed);
  const double weighted_s = readout_side + absorbed.dot(pose_side);
  if (!(information > 0) || !std::isfinite(information) || !std::isfinite(weighted_s)) return;
  if (blocks_.empty() || blocks_.back().frames == kFramesPerBlock) blocks_.emplace_back();
  Block& block = blocks_.back();
  ++block.frames;
  block.information += information;
  block.weighted_s += weighted_s;
}

std::optional<ReadoutError> ReadoutEstimator::Estimate() const {
  if (blocks_.size() < kMinBlocks) return std::nullopt;
  double information = 0, weighted_s = 0;
  for (const Block& block : blocks_) {
    information += block.information;
    weighted_s += block.weighted_s;
  }
  ReadoutError error{.value_s = weighted_s / information};
  double scatter = 0;
  for (const Block& block : blocks_) {
    const double share = block.information / information;
    const double deviation_s = block.weighted_s / block.information - error.value_s;
    scatter += share * share * deviation_s * deviation_s;
  }
  const auto count = static_cast<double>(blocks_.size());
  error.sigma_s = std::sqrt(scatter * count / (count - 1));
  return error;
}

}  // namespace romap::slam
