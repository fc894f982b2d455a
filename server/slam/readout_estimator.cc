#include "server/slam/readout_estimator.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "server/slam/geometry/levenberg_marquardt.h"
#include "server/slam/geometry/rotation.h"

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
  // Parameters: translation and rotation of the camera's frame (see ApplyStep in reprojection.h), then the readout
  // error.
  NormalEquations<7> equations;
  double motion_px_per_s = 0;
  for (const Observation& observed : observations) {
    const PoseObservation& observation = observed.observation;
    const Eigen::Vector3d p = T_camera_world * observation.p_world;
    if (!(p.z() > 0)) continue;
    Eigen::Matrix<double, 2, 3> projection;
    projection << camera.fx_px / p.z(), 0, -camera.fx_px * p.x() / (p.z() * p.z()),  //
        0, camera.fy_px / p.z(), -camera.fy_px * p.y() / (p.z() * p.z());
    const Eigen::Vector2d flow_px_per_s = projection * (motion.rotation_rad.cross(p) + motion.translation_mu);
    Eigen::Matrix<double, 2, 7> derivative;
    derivative << projection, -projection * Skew(p), -observed.read_at * flow_px_per_s;
    const Eigen::Vector2d error_px = camera.Project(p) - observation.pixel_px;
    for (int axis = 0; axis < 2; ++axis) {
      equations.Add(derivative.row(axis).transpose() / observation.sigma_px, error_px[axis] / observation.sigma_px, 1);
    }
    motion_px_per_s += flow_px_per_s.norm() / static_cast<double>(observations.size());
  }
  if (motion_px_per_s < kMinMotion_px_per_s) return;
  // Eliminates the pose.
  const Eigen::Matrix<double, 6, 1> coupling = equations.hessian.block<6, 1>(0, 6);
  const Eigen::Matrix<double, 6, 1> absorbed = equations.hessian.topLeftCorner<6, 6>().ldlt().solve(coupling);
  const double information = equations.hessian(6, 6) - coupling.dot(absorbed);
  const double weighted_s = absorbed.dot(equations.gradient.head<6>()) - equations.gradient[6];
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
