#include "server/slam/geometry/pose_refiner.h"

#include <cmath>

#include "server/slam/geometry/levenberg_marquardt.h"
#include "server/slam/geometry/reprojection.h"

namespace romap::slam {
namespace {

constexpr int kMinObservations = 4;

bool IsUsable(const PoseObservation& observation) {
  return observation.sigma_px > 0 && observation.p_world.allFinite() && observation.pixel_px.allFinite();
}

// Marks the observations for the first round: those with a reprojection error below the image's width + height. A point
// that projects farther away is a wrong match, and a point near the camera plane would dominate all others. Returns the
// number of marked observations.
int MarkPlausible(const CameraModel& camera, const CameraFromWorld& pose, std::span<const PoseObservation> observations,
                  std::vector<uint8_t>& active) {
  const double max_error_px = camera.width_px + camera.height_px;
  int count = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    active[i] = 0;
    if (!IsUsable(observations[i])) continue;
    const Eigen::Vector3d p_camera = pose.rotation * observations[i].p_world + pose.translation;
    if (!(p_camera.z() > 0)) continue;
    active[i] = (camera.Project(p_camera) - observations[i].pixel_px).squaredNorm() < max_error_px * max_error_px;
    count += active[i];
  }
  return count;
}

// Marks the observations that agree with the pose and returns their number.
int MarkInliers(const CameraModel& camera, const CameraFromWorld& pose, std::span<const PoseObservation> observations,
                std::vector<uint8_t>& inlier) {
  int count = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    const PoseObservation& observation = observations[i];
    inlier[i] = IsUsable(observation) && ErrorOf(camera, pose, observation).chi2 <= Chi2Bound(observation);
    count += inlier[i];
  }
  return count;
}

double RmsError_px(const CameraModel& camera, const CameraFromWorld& pose,
                   std::span<const PoseObservation> observations, const PoseEstimate& estimate) {
  double sum_px2 = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (!estimate.inlier[i]) continue;
    const double sigma_px = observations[i].sigma_px;
    sum_px2 += ErrorOf(camera, pose, observations[i]).pixel.squaredNorm() * sigma_px * sigma_px;
  }
  return std::sqrt(sum_px2 / estimate.inliers);
}

}  // namespace

PoseEstimate RefinePose(const CameraModel& camera, const SE3<World, Camera>& start,
                        std::span<const PoseObservation> observations, const PoseRefinerOptions& options) {
  const SE3<Camera, World> T_camera_world = start.Inverse();
  CameraFromWorld pose{T_camera_world.RotationMatrix(), T_camera_world.translation()};
  std::vector<uint8_t> active(observations.size());
  std::vector<uint8_t> next_active(observations.size());
  int active_count = options.start_is_close ? MarkInliers(camera, pose, observations, active)
                                            : MarkPlausible(camera, pose, observations, active);
  const auto linearize = [&](const CameraFromWorld& at) {
    PoseEquations equations;
    for (size_t i = 0; i < observations.size(); ++i) {
      if (active[i]) AddObservation(camera, at, observations[i], equations);
    }
    return equations;
  };
  for (int round = 0; round < options.rounds && active_count >= kMinObservations; ++round) {
    const auto move = [](const CameraFromWorld& at, const PoseEquations::Vector& step) { return ApplyStep(at, step); };
    Minimize<6>(options.iterations_per_round, linearize, move, pose);
    active_count = MarkInliers(camera, pose, observations, next_active);
    if (next_active == active) break;
    active.swap(next_active);
  }

  PoseEstimate estimate;
  estimate.T_world_camera = SE3<Camera, World>(pose.rotation, pose.translation).Inverse();
  estimate.inlier.assign(observations.size(), 0);
  if (active_count < kMinObservations) return estimate;
  estimate.inliers = MarkInliers(camera, pose, observations, estimate.inlier);
  if (estimate.inliers < kMinObservations) {
    estimate.inlier.assign(observations.size(), 0);
    estimate.inliers = 0;
    return estimate;
  }
  estimate.rms_px = RmsError_px(camera, pose, observations, estimate);
  return estimate;
}

}  // namespace romap::slam
