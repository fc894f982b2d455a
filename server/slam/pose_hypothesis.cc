#include "server/slam/pose_hypothesis.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "server/slam/geometry/projection_ray.h"

namespace romap::slam {
namespace {

std::vector<PoseHypothesis> MakeHypotheses() {
  std::vector<PoseHypothesis> hypotheses;
  for (int flags = 0; flags < 8; ++flags) {
    hypotheses.push_back({.wxyz = (flags & 1) != 0, .world_to_camera = (flags & 2) != 0, .opengl = (flags & 4) != 0});
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(), [](const PoseHypothesis& a, const PoseHypothesis& b) {
    const auto count = [](const PoseHypothesis& h) {
      return static_cast<int>(h.wxyz) + static_cast<int>(h.world_to_camera) + static_cast<int>(h.opengl);
    };
    return count(a) < count(b);
  });
  hypotheses.push_back({.mirrored = true});
  hypotheses.push_back({.upside_down = true});
  hypotheses.push_back({.mirrored = true, .upside_down = true});
  // Ratios of usual image sizes.
  for (const double factor : {0.5, 2.0, 2.0 / 3, 1.5, 1.0 / 3, 3.0, 0.25, 4.0}) {
    hypotheses.push_back({.resolution_factor = factor});
    hypotheses.push_back({.focal_factor = factor});
  }
  return hypotheses;
}

}  // namespace

const std::vector<PoseHypothesis>& AllPoseHypotheses() {
  static const std::vector<PoseHypothesis> hypotheses = MakeHypotheses();
  return hypotheses;
}

SE3<World, Camera> ReadPose(const PoseHypothesis& hypothesis, const SE3<World, Camera>& given) {
  SE3<World, Camera> pose = given;
  if (hypothesis.wxyz) {
    const Eigen::Quaterniond& q = given.rotation();
    pose = {Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()), given.translation()};
  }
  if (hypothesis.world_to_camera) {
    const SE3<Camera, World> inverse = pose.Inverse();
    pose = {inverse.rotation(), inverse.translation()};
  }
  if (hypothesis.opengl) {
    const Eigen::Quaterniond half_turn_about_x(0, 1, 0, 0);
    pose = {pose.rotation() * half_turn_about_x, pose.translation()};
  }
  return pose;
}

CameraModel ReadCamera(const PoseHypothesis& hypothesis, const CameraModel& given) {
  CameraModel camera = given;
  camera.fx_px *= hypothesis.resolution_factor * hypothesis.focal_factor;
  camera.fy_px *= hypothesis.resolution_factor * hypothesis.focal_factor;
  // Pixel centers are at integers, the image begins at -0.5.
  camera.cx_px = (given.cx_px + 0.5) * hypothesis.resolution_factor - 0.5;
  camera.cy_px = (given.cy_px + 0.5) * hypothesis.resolution_factor - 0.5;
  // A negative focal length maps a pixel of the flipped image to the ray of the pixel from where it came.
  if (hypothesis.mirrored) {
    camera.fx_px = -camera.fx_px;
    camera.cx_px = given.width_px - 1 - camera.cx_px;
  }
  if (hypothesis.upside_down) {
    camera.fy_px = -camera.fy_px;
    camera.cy_px = given.height_px - 1 - camera.cy_px;
  }
  return camera;
}

SE3<Camera, Camera> ReadMotion(const PoseHypothesis& hypothesis, const SE3<World, Camera>& first,
                               const SE3<World, Camera>& second) {
  return ReadPose(hypothesis, second).Inverse() * ReadPose(hypothesis, first);
}

std::vector<bool> Explained(const CameraModel& camera, const SE3<Camera, Camera>& motion,
                            std::span<const TwoViewMatch> matches, double max_distance_px) {
  const Eigen::Matrix3d rotation = motion.RotationMatrix();
  std::vector<bool> explained;
  explained.reserve(matches.size());
  for (const TwoViewMatch& match : matches) {
    const Eigen::Vector3d ray = camera.Unproject(match.first_px.x(), match.first_px.y());
    explained.push_back(DistanceToProjectionRay_px(camera, rotation, motion.translation(), ray, match.second_px) <
                        max_distance_px);
  }
  return explained;
}

double ShareOf(const std::vector<bool>& explained) {
  const auto count = std::count(explained.begin(), explained.end(), true);
  return explained.empty() ? 0 : static_cast<double>(count) / static_cast<double>(explained.size());
}

std::string Describe(const PoseHypothesis& hypothesis) {
  std::vector<std::string> parts;
  if (hypothesis.world_to_camera) parts.emplace_back("as world-to-camera");
  if (hypothesis.wxyz) parts.emplace_back("with w first in the quaternions");
  if (hypothesis.opengl) parts.emplace_back("with OpenGL camera axes");
  if (hypothesis.mirrored && hypothesis.upside_down) {
    parts.emplace_back("as turned by 180 degrees");
  } else if (hypothesis.IsFlip()) {
    parts.emplace_back(hypothesis.mirrored ? "as mirrored left to right" : "as mirrored top to bottom");
  }
  return fmt::format("{}", fmt::join(parts, " and "));
}

std::string ConventionOption(const PoseHypothesis& hypothesis) {
  std::vector<std::string> parts;
  if (hypothesis.wxyz) parts.emplace_back("wxyz");
  if (hypothesis.world_to_camera) parts.emplace_back("world_to_camera");
  if (hypothesis.opengl) parts.emplace_back("opengl");
  return fmt::format("{}", fmt::join(parts, ","));
}

}  // namespace romap::slam
