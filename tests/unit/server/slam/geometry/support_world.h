#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <numbers>
#include <random>
#include <vector>

#include "common/angles.h"
#include "server/slam/geometry/support_plane.h"

namespace romap::slam {

// A sparse monocular map of boxes on a table, observed from above along an arc, with adjustable errors. Built in meters
// with the table at z = 0, then transformed by a random similarity, because the frame and scale of a monocular map are
// arbitrary.
class SupportWorld {
 public:
  struct Options {
    int table_points = 200;
    double table_half_width = 0.6;
    int object_points = 120;
    double object_bottom = 0;    // lowest height of object points, as a share of the object's height
    int floor_points = 0;        // 0.75 m below the table, visible beside it
    int wall_points = 0;         // upright, behind the table
    int clutter_points = 0;      // on top of the table, unlabeled, up to 0.25 high
    double outlier_share = 0;    // share of the table points at random heights
    double depth_noise = 0.005;  // relative, along the ray
    double sigma_factor = 1;     // ratio of the stated to the true uncertainty
    double elevation_rad = 35 * kRadPerDeg;
    uint64_t seed = 1;
  };

  explicit SupportWorld(const Options& options) : options_(options), random_(options.seed) {
    rotation_ = Eigen::Quaterniond(Normal(), Normal(), Normal(), Normal()).normalized();
    scale_ = std::exp(3 * Normal());
    shift_ = 10 * scale_ * Eigen::Vector3d(Normal(), Normal(), Normal());
    AddCameras();
    AddObjects();
    AddSurroundings();
  }

  SupportPlaneQuery Query(uint64_t seed = 1) const {
    return {.points = points,
            .object_points_world = object_points,
            .camera_centers_world = camera_centers,
            .camera_ups_world = camera_ups,
            .seed = seed};
  }

  Eigen::Vector3d up() const { return rotation_ * Eigen::Vector3d::UnitZ(); }
  double scale() const { return scale_; }
  double TiltError_rad(const SupportPlane& plane) const {
    return std::acos(std::clamp(plane.normal_world.dot(up()), -1.0, 1.0));
  }
  // Distance in meters of the estimated plane from the table under the objects.
  double HeightError_m(const SupportPlane& plane) const {
    return std::abs(plane.normal_world.dot(ToMap({0, 0, 0})) - plane.offset_mu) / scale_;
  }

  std::vector<SupportPoint> points;
  std::vector<Eigen::Vector3d> object_points;
  std::vector<Eigen::Vector3d> camera_centers;
  std::vector<Eigen::Vector3d> camera_ups;

 private:
  double Normal() { return std::normal_distribution<double>()(random_); }
  double Uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Eigen::Vector3d ToMap(const Eigen::Vector3d& p) const { return scale_ * (rotation_ * p) + shift_; }

  // The triangulated position of the point, in the map.
  Eigen::Vector3d Measured(const Eigen::Vector3d& p) {
    const Eigen::Vector3d center = centers_m_[random_() % centers_m_.size()];
    return ToMap(center + (1 + options_.depth_noise * Normal()) * (p - center));
  }

  void AddCameras() {
    for (int i = 0; i < 20; ++i) {
      const double azimuth = 0.05 * i;
      const double elevation = options_.elevation_rad + 0.05 * Normal();
      const Eigen::Vector3d back(-std::cos(elevation) * std::cos(azimuth), -std::cos(elevation) * std::sin(azimuth),
                                 std::sin(elevation));
      const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(back).normalized();
      centers_m_.push_back(1.2 * back);
      camera_centers.push_back(ToMap(centers_m_.back()));
      // A hand-held camera is not level.
      camera_ups.push_back(rotation_ * (Eigen::AngleAxisd(0.1 * Normal(), back) * back.cross(right)));
    }
  }

  void AddObjects() {
    const Eigen::Vector3d centers[] = {{-0.2, 0.1, 0}, {0.15, -0.15, 0}, {0.25, 0.2, 0}};
    for (int i = 0; i < options_.object_points; ++i) {
      const double height = 0.08 + 0.06 * (i % 3);
      object_points.push_back(Measured(centers[i % 3] + Eigen::Vector3d(Uniform(-0.05, 0.05), Uniform(-0.05, 0.05),
                                                                        Uniform(options_.object_bottom, 1) * height)));
    }
  }

  void AddPoint(const Eigen::Vector3d& p, bool near_object) {
    points.push_back({.position_world = Measured(p),
                      .sigma_mu = options_.sigma_factor * options_.depth_noise * (p - centers_m_[0]).norm() * scale_,
                      .near_object = near_object});
  }

  void AddSurroundings() {
    const double half = options_.table_half_width;
    for (int i = 0; i < options_.table_points; ++i) {
      const bool is_outlier = Uniform(0, 1) < options_.outlier_share;
      const Eigen::Vector3d p(Uniform(-half, half), Uniform(-half, half), is_outlier ? Uniform(-0.3, 0.5) : 0);
      AddPoint(p, p.head<2>().norm() < 0.35);
    }
    for (int i = 0; i < options_.floor_points; ++i) {
      AddPoint({Uniform(-0.5, 3), Uniform(-2, 2), -0.75}, i % 10 == 0);
    }
    for (int i = 0; i < options_.wall_points; ++i) AddPoint({0.8, Uniform(-2, 2), Uniform(-0.5, 1.5)}, i % 10 == 0);
    for (int i = 0; i < options_.clutter_points; ++i) {
      AddPoint({Uniform(-half, half), Uniform(-half, half), Uniform(0, 0.25)}, i % 3 == 0);
    }
  }

  Options options_;
  std::mt19937_64 random_;
  Eigen::Quaterniond rotation_;
  double scale_ = 1;
  Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> centers_m_;
};

}  // namespace romap::slam
