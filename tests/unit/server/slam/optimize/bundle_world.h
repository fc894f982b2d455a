#pragma once

// Synthetic worlds with known ground truth for bundle adjustment: cameras on an orbit around a ball of points, with
// adjustable noise.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "server/slam/optimize/bundle_adjustment.h"

namespace romap::slam {

struct BundleWorldOptions {
  int cameras = 10;
  int fixed_cameras = 2;  // the first ones; they start at their true poses
  int points = 200;
  int observations_per_point = 6;  // by this many consecutive cameras
  double step_rad = 0.1;           // between neighbors on the orbit
  double scale = 1;                // map units; the orbit's radius is 3, the ball's 1
  double pixel_noise_px = 0;       // standard deviation per axis
  double pose_noise_rad = 0;       // of the start, per axis
  double pose_noise_mu = 0;        // of the start, per axis, before `scale`
  double point_noise_mu = 0;       // of the start, per axis, before `scale`
  double outlier_share = 0;        // share of the observations that are at random pixels
  bool with_depth = false;         // observations include depth
  double depth_noise_mu = 0.01;    // before `scale`
  unsigned seed = 1;
};

struct BundleWorld {
  BundleProblem problem;  // the noisy start
  std::vector<SE3<World, Camera>> true_poses;
  std::vector<Eigen::Vector3d> true_points;
  std::vector<bool> wrong;  // per observation: an outlier by construction
};

inline CameraModel BundleWorldCamera() {
  CameraModel camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx_px = 500;
  camera.fy_px = 510;
  camera.cx_px = 320;
  camera.cy_px = 240;
  return camera;
}

// At `angle_rad` on a circle of radius 3 in the xy plane, looking at its center.
inline SE3<World, Camera> OrbitPose(double angle_rad, double scale) {
  const Eigen::Vector3d outward(std::cos(angle_rad), std::sin(angle_rad), 0);
  Eigen::Matrix3d R;
  R.col(2) = -outward;
  R.col(1) = -Eigen::Vector3d::UnitZ();
  R.col(0) = R.col(1).cross(R.col(2));
  return {R, 3 * scale * outward};
}

class BundleWorldMaker {
 public:
  explicit BundleWorldMaker(const BundleWorldOptions& options) : options_(options), random_(options.seed) {}

  BundleWorld Make() {
    world_.problem.camera = BundleWorldCamera();
    MakeCameras();
    for (int i = 0; i < options_.points; ++i) MakePoint(i);
    return std::move(world_);
  }

 private:
  double Normal(double sigma) { return sigma * std::normal_distribution<double>()(random_); }
  Eigen::Vector3d NormalVector(double sigma) {
    const double x = Normal(sigma);
    const double y = Normal(sigma);
    return {x, y, Normal(sigma)};
  }
  double Uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

  void MakeCameras() {
    for (int i = 0; i < options_.cameras; ++i) {
      const SE3<World, Camera> pose = OrbitPose(i * options_.step_rad, options_.scale);
      world_.true_poses.push_back(pose);
      BundleCamera camera;
      camera.fixed = i < options_.fixed_cameras;
      camera.T_world_camera = pose;
      if (!camera.fixed) {
        const Eigen::Vector3d turn_rad = NormalVector(options_.pose_noise_rad);
        const double angle_rad = turn_rad.norm();
        const Eigen::Quaterniond turn(Eigen::AngleAxisd(
            angle_rad, angle_rad > 0 ? Eigen::Vector3d(turn_rad / angle_rad) : Eigen::Vector3d::UnitX()));
        camera.T_world_camera = {pose.rotation() * turn,
                                 pose.translation() + options_.scale * NormalVector(options_.pose_noise_mu)};
      }
      world_.problem.cameras.push_back(camera);
    }
  }

  void MakePoint(int index) {
    Eigen::Vector3d p_world;
    do {
      const double x = Uniform(-1, 1);
      const double y = Uniform(-1, 1);
      p_world = {x, y, Uniform(-1, 1)};
    } while (p_world.norm() > 1);
    p_world *= options_.scale;
    world_.true_points.push_back(p_world);
    world_.problem.points.push_back({p_world + options_.scale * NormalVector(options_.point_noise_mu), false});

    const int observations = std::min(options_.observations_per_point, options_.cameras);
    const auto first = static_cast<int>(Uniform(0, options_.cameras - observations + 1));
    for (int i = first; i < first + observations; ++i) MakeObservation(i, index, p_world);
  }

  void MakeObservation(int camera, int point, const Eigen::Vector3d& p_world) {
    const CameraModel& model = world_.problem.camera;
    const Eigen::Vector3d p_camera = world_.true_poses[camera].Inverse() * p_world;
    BundleObservation observation;
    observation.camera = camera;
    observation.point = point;
    observation.sigma_px = options_.pixel_noise_px > 0 ? options_.pixel_noise_px : 1;
    const double noise_x_px = Normal(options_.pixel_noise_px);
    const double noise_y_px = Normal(options_.pixel_noise_px);
    observation.pixel_px = model.Project(p_camera) + Eigen::Vector2d(noise_x_px, noise_y_px);
    if (options_.with_depth) {
      observation.depth_sigma_mu = options_.scale * options_.depth_noise_mu;
      observation.depth_mu = p_camera.z() + Normal(observation.depth_sigma_mu);
    }
    const bool wrong = Uniform(0, 1) < options_.outlier_share;
    if (wrong) {
      const double x_px = Uniform(0, model.width_px);
      observation.pixel_px = {x_px, Uniform(0, model.height_px)};
    }
    world_.wrong.push_back(wrong);
    world_.problem.observations.push_back(observation);
  }

  BundleWorldOptions options_;
  std::mt19937_64 random_;
  BundleWorld world_;
};

inline BundleWorld MakeBundleWorld(const BundleWorldOptions& options) { return BundleWorldMaker(options).Make(); }

}  // namespace romap::slam
