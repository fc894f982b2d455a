#include "server/slam/geometry/pnp.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

#include "server/slam/geometry/random_sample.h"
#include "server/slam/geometry/reprojection.h"

namespace romap::slam {
namespace {

constexpr int kPoseSampleSize = 3;

using PoseSample = std::array<PoseObservation, kPoseSampleSize>;

// The poses, at most four, that agree with three observations. The input of OpenCV's solver are rays, so the camera
// matrix is the identity.
std::vector<CameraFromWorld> SolveP3p(const CameraModel& camera, const PoseSample& sample) {
  std::array<cv::Point3d, kPoseSampleSize> points;
  std::array<cv::Point2d, kPoseSampleSize> rays;
  for (int i = 0; i < kPoseSampleSize; ++i) {
    const Eigen::Vector3d& p_world = sample[i].p_world;
    const Eigen::Vector3d ray = camera.Unproject(sample[i].pixel_px.x(), sample[i].pixel_px.y());
    points[i] = {p_world.x(), p_world.y(), p_world.z()};
    rays[i] = {ray.x(), ray.y()};
  }
  std::vector<CameraFromWorld> poses;
  std::vector<cv::Mat> turns;
  std::vector<cv::Mat> shifts;
  try {
    cv::solveP3P(points, rays, cv::Matx33d::eye(), cv::noArray(), turns, shifts, cv::SOLVEPNP_P3P);
  } catch (const cv::Exception&) {
    return poses;  // a degenerate sample
  }
  for (size_t i = 0; i < turns.size(); ++i) {
    cv::Matx33d rotation;
    cv::Rodrigues(turns[i], rotation);
    CameraFromWorld pose;
    pose.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.val);
    pose.translation = Eigen::Map<const Eigen::Vector3d>(shifts[i].ptr<double>());
    if (pose.rotation.allFinite() && pose.translation.allFinite()) poses.push_back(pose);
  }
  return poses;
}

struct PoseScore {
  double support = 0;  // inliers, weighted from 1 (exact) to 0 (at the bound): MSAC, Torr and Zisserman 2000
  int inliers = 0;
};

PoseScore ScorePose(const CameraModel& camera, const CameraFromWorld& pose,
                    std::span<const PoseObservation> observations) {
  PoseScore score;
  for (const PoseObservation& observation : observations) {
    const double normalized_chi2 = ErrorOf(camera, pose, observation).chi2 / Chi2Bound(observation);
    if (!(normalized_chi2 <= 1)) continue;
    score.support += 1 - normalized_chi2;
    ++score.inliers;
  }
  return score;
}

SE3<World, Camera> WorldFromCamera(const CameraFromWorld& pose) {
  return SE3<Camera, World>(pose.rotation, pose.translation).Inverse();
}

}  // namespace

std::optional<PoseEstimate> SolvePnp(const CameraModel& camera, std::span<const PoseObservation> observations,
                                     const PnpOptions& options) {
  const int count = static_cast<int>(observations.size());
  if (count < std::max(kPoseSampleSize, options.min_inliers)) return std::nullopt;
  std::mt19937_64 random(options.seed);
  std::optional<PoseEstimate> best;
  double best_support = 0;
  int needed = options.max_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    PoseSample sample;
    const std::array<int, kPoseSampleSize> indices = SampleDistinct<kPoseSampleSize>(count, random);
    for (int i = 0; i < kPoseSampleSize; ++i) sample[i] = observations[indices[i]];
    for (const CameraFromWorld& pose : SolveP3p(camera, sample)) {
      const PoseScore score = ScorePose(camera, pose, observations);
      if (score.support <= best_support) continue;
      best_support = score.support;
      // A pose from three noisy points is inaccurate and misses inliers. Immediate refinement (Chum et al. 2003) gives
      // a better estimate of the number of samples that are still needed.
      PoseEstimate refined = RefinePose(camera, WorldFromCamera(pose), observations, {.start_is_close = true});
      if (best && refined.inliers < best->inliers) continue;
      best = std::move(refined);
      const double inlier_share = static_cast<double>(best->inliers) / count;
      needed = SamplesNeeded(inlier_share, kPoseSampleSize, options.max_iterations);
    }
  }
  if (!best || best->inliers < options.min_inliers) return std::nullopt;
  return best;
}

}  // namespace romap::slam
