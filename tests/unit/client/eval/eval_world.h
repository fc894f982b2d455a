#pragma once

// Small synthetic worlds with known results for the tests of this folder.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "client/eval/alignment.h"
#include "client/files/objects_yaml.h"
#include "client/files/ply.h"
#include "client/files/tum.h"
#include "common/mesh.h"

namespace romap::eval_world {

// A temporary folder of the current test; removed by the destructor.
class TempFolder {
 public:
  TempFolder() {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    path_ = testing::TempDir() + "romap_eval_" + info->test_suite_name() + "_" + info->name();
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TempFolder() { std::filesystem::remove_all(path_); }

  // Path of a file in the folder. Creates the parent folders.
  std::string operator/(const std::string& name) const {
    const std::filesystem::path path = std::filesystem::path(path_) / name;
    std::filesystem::create_directories(path.parent_path());
    return path.string();
  }

 private:
  std::string path_;
};

// A sphere of longitude-latitude quads, without the faces whose center is below `min_z` (relative to the sphere
// center).
inline Mesh Sphere(double radius, const Eigen::Vector3d& center, int around = 120, double min_z = -1e9) {
  const int rings = around / 2;
  Mesh mesh;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < around; ++j) {
      const double theta = std::numbers::pi * i / rings, phi = 2 * std::numbers::pi * j / around;
      const Eigen::Vector3d n(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
      mesh.vertices.push_back((radius * n + center).cast<float>());
    }
  }
  const auto index = [&](int i, int j) { return static_cast<uint32_t>(i * around + j % around); };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < around; ++j) {
      if (radius * std::cos(std::numbers::pi * (i + 0.5) / rings) < min_z) continue;
      mesh.triangles.push_back({index(i, j), index(i + 1, j), index(i, j + 1)});
      mesh.triangles.push_back({index(i, j + 1), index(i + 1, j), index(i + 1, j + 1)});
    }
  }
  return mesh;
}

inline Mesh Box(const Eigen::Vector3d& half_extents, const Eigen::Vector3d& center) {
  Mesh mesh;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3d sign(k & 4 ? 1 : -1, k & 2 ? 1 : -1, k & 1 ? 1 : -1);
    mesh.vertices.push_back((half_extents.cwiseProduct(sign) + center).cast<float>());
  }
  mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                    {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  return mesh;
}

inline Mesh Moved(Mesh mesh, const Sim3<World, World>& similarity) {
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex = (similarity * vertex.cast<double>()).cast<float>();
  return mesh;
}

// A similarity far from identity, from the ground-truth world to another one.
inline Sim3<World, World> OtherWorld() {
  return {0.37, Eigen::Quaterniond(Eigen::AngleAxisd(1.4, Eigen::Vector3d(0.4, -1.1, 0.8).normalized())),
          Eigen::Vector3d(3, -2, 5)};
}

// Camera poses on a wavy circle of radius 1, facing the origin, at 25 Hz.
inline std::vector<files::StampedPose> Orbit(int count = 200) {
  std::vector<files::StampedPose> poses;
  for (int k = 0; k < count; ++k) {
    const double a = 2 * std::numbers::pi * k / count;
    const Eigen::Vector3d position(std::cos(a), std::sin(a), 0.3 + 0.2 * std::sin(3 * a));
    Eigen::Matrix3d rotation;
    rotation.col(2) = -position.normalized();
    rotation.col(0) = Eigen::Vector3d(0, 0, -1).cross(rotation.col(2)).normalized();
    rotation.col(1) = rotation.col(2).cross(rotation.col(0));
    poses.push_back({k * int64_t{40'000'000}, {rotation, position}});
  }
  return poses;
}

inline std::vector<files::StampedPose> Moved(std::vector<files::StampedPose> poses,
                                             const Sim3<World, World>& similarity) {
  for (files::StampedPose& pose : poses) pose.T_world_camera = similarity.Moved(pose.T_world_camera);
  return poses;
}

// The poses with positions scaled about the first one by a factor that may depend on the index.
template <class Factor>
std::vector<files::StampedPose> WithLocalScale(const std::vector<files::StampedPose>& poses, Factor factor) {
  std::vector<files::StampedPose> scaled = poses;
  Eigen::Vector3d position = poses.front().T_world_camera.translation();
  for (size_t k = 1; k < poses.size(); ++k) {
    position += factor(k) * (poses[k].T_world_camera.translation() - poses[k - 1].T_world_camera.translation());
    scaled[k].T_world_camera = {poses[k].T_world_camera.rotation(), position};
  }
  return scaled;
}

// Deterministic noise: the poses with normal errors of position (standard deviation per axis).
inline std::vector<files::StampedPose> WithNoise(std::vector<files::StampedPose> poses, double sigma_m, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (files::StampedPose& pose : poses) {
    const double x = normal(random), y = normal(random), z = normal(random);
    pose.T_world_camera = {pose.T_world_camera.rotation(),
                           Eigen::Vector3d(pose.T_world_camera.translation() + sigma_m * Eigen::Vector3d(x, y, z))};
  }
  return poses;
}

inline files::ObjectRecord UprightCuboid(int64_t id, const Eigen::Vector3d& center, double yaw_rad,
                                         const Eigen::Vector3d& half_extents) {
  return {id,           fmt::format("b{}", id),
          "box",        {Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())), center},
          half_extents, {}};
}

// Mean nearest distance between two random samplings of the same surface: 0.5 / sqrt(density).
inline double SamplingFloor_cm(double area_cm2, double samples) { return 0.5 * std::sqrt(area_cm2 / samples); }

}  // namespace romap::eval_world
