#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "server/slam/slam_map.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam {

// Four keyframes on a line that observe the same points with exact pixels. Except for the first keyframe, all poses and
// points of the map have errors.
class NoisyMap : public ::testing::Test {
 protected:
  NoisyMap() {
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 60; ++i) {
      true_points_.emplace_back(0.6 + uniform(random_), uniform(random_), 4.5 + uniform(random_));
    }
    for (int i = 0; i < 4; ++i) AddKeyframe(0.4 * i, i == 0 ? 0 : 0.02);
    for (size_t i = 0; i < true_points_.size(); ++i) {
      PointTrack& track = map_.AddPoint(true_points_[i] + Error(0.05));
      for (auto& [id, keyframe] : map_.keyframes()) map_.AddObservation(track, keyframe, static_cast<int>(i));
      map_.Refresh(track);
    }
  }

  Eigen::Vector3d Error(double sigma_mu) {
    std::normal_distribution<double> normal;  // times sigma, which may be 0
    const double x_mu = normal(random_);
    const double y_mu = normal(random_);
    return sigma_mu * Eigen::Vector3d(x_mu, y_mu, normal(random_));
  }

  MapKeyframe& AddKeyframe(double x_mu, double position_sigma_mu) {
    const SE3<World, Camera> truth(Eigen::Quaterniond::Identity(), {x_mu, 0, 0});
    Frame frame;
    frame.camera = TexturedWorld().camera();
    std::vector<Feature> features;
    for (const Eigen::Vector3d& p_world : true_points_) {
      features.push_back({.pixel_px = frame.camera.Project(truth.Inverse() * p_world).cast<float>()});
    }
    return map_.AddKeyframe(MakeFrameFeatures(frame, features),
                            {truth.rotation(), truth.translation() + Error(position_sigma_mu)});
  }

  double RmsError_px() const {
    double sum_px2 = 0;
    int count = 0;
    for (const auto& [id, track] : map_.points()) {
      for (const FeatureRef& observation : track.observations) {
        const MapKeyframe& keyframe = *map_.FindKeyframe(observation.keyframe);
        const Eigen::Vector2f pixel_px = keyframe.features()[static_cast<size_t>(observation.feature)].pixel_px;
        const Eigen::Vector3d p_camera = keyframe.T_camera_world() * track.point.position_world;
        sum_px2 += (keyframe.camera().Project(p_camera) - pixel_px.cast<double>()).squaredNorm();
        ++count;
      }
    }
    return std::sqrt(sum_px2 / count);
  }

  std::vector<Eigen::Vector3d> Centers() const {
    std::vector<Eigen::Vector3d> centers_world;
    for (const auto& [id, keyframe] : map_.keyframes()) centers_world.push_back(keyframe.center_world());
    return centers_world;
  }

  std::mt19937_64 random_{4};
  std::vector<Eigen::Vector3d> true_points_;
  SlamMap map_{SlamConfig{}};
};

}  // namespace romap::slam
