#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "common/angles.h"
#include "common/stage_messages.h"

namespace romap::slam {

// A world with exact geometry for the tests of this folder: a textured floor (z = 0) and above it a smaller textured
// plate (z = kPlateHeight_mu) that carries label kPlateLabel, seen by a pinhole camera.
class TexturedWorld {
 public:
  static constexpr double kFloorHalfSide_mu = 2.5;
  static constexpr double kPlateHalfSide_mu = 0.35;
  static constexpr double kPlateHeight_mu = 0.3;
  static constexpr uint16_t kPlateLabel = 7;

  explicit TexturedWorld(int width_px = 320, int height_px = 240, uint64_t seed = 1) {
    camera_ = {.width_px = width_px,
               .height_px = height_px,
               .fx_px = 0.9 * width_px,
               .fy_px = 0.9 * width_px,
               .cx_px = 0.5 * (width_px - 1),
               .cy_px = 0.5 * (height_px - 1)};
    cv::RNG random(seed);
    floor_ = RandomTexture(1200, random);
    plate_ = RandomTexture(300, random);
  }

  const CameraModel& camera() const { return camera_; }

  // Looks at `target` from `eye`; the image's up is world z (world y when looking straight down).
  static SE3<World, Camera> LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
    const Eigen::Vector3d forward = (target - eye).normalized();
    const bool vertical = std::abs(forward.z()) > 0.999;
    const Eigen::Vector3d up = vertical ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
    Eigen::Matrix3d axes;
    axes.col(2) = forward;
    axes.col(0) = forward.cross(up).normalized();
    axes.col(1) = forward.cross(axes.col(0));
    return {axes, eye};
  }

  // A camera on a circle of radius 1.2 mu, 1.2 mu above the floor, looking at the plate.
  static SE3<World, Camera> OrbitPose(double angle_deg) {
    const double angle_rad = angle_deg * kRadPerDeg;
    return LookAt({1.2 * std::cos(angle_rad), 1.2 * std::sin(angle_rad), 1.2}, {0, 0, 0.2});
  }

  // A frame of the world with noise of standard deviation `noise` gray levels, with mask and pose, without depth.
  std::shared_ptr<Frame> Render(uint64_t frame_id, const SE3<World, Camera>& T_world_camera, double noise = 2) const {
    auto frame = std::make_shared<Frame>();
    frame->frame_id = frame_id;
    frame->timestamp_ns = static_cast<int64_t>(frame_id) * 33'000'000;
    frame->camera = camera_;
    frame->T_world_camera = T_world_camera;
    frame->has_masks = true;
    const cv::Size size(camera_.width_px, camera_.height_px);
    cv::Mat gray(size, CV_8UC1, cv::Scalar(0));
    frame->labels = cv::Mat(size, CV_16UC1, cv::Scalar(0));

    cv::Mat layer, inside;
    cv::warpPerspective(floor_, gray, FromTexture(T_world_camera, floor_, kFloorHalfSide_mu, 0), size, cv::INTER_AREA);
    const cv::Matx33d H = FromTexture(T_world_camera, plate_, kPlateHalfSide_mu, kPlateHeight_mu);
    cv::warpPerspective(plate_, layer, H, size, cv::INTER_AREA);
    cv::warpPerspective(cv::Mat(plate_.size(), CV_8UC1, cv::Scalar(255)), inside, H, size, cv::INTER_NEAREST);
    layer.copyTo(gray, inside);
    frame->labels.setTo(kPlateLabel, inside);

    cv::Mat noisy, grain(size, CV_16SC1);
    cv::RNG random(1000 + frame_id);
    random.fill(grain, cv::RNG::NORMAL, 0, noise);
    cv::add(gray, grain, noisy, cv::noArray(), CV_8U);
    cv::cvtColor(noisy, frame->image_bgr, cv::COLOR_GRAY2BGR);
    return frame;
  }

  // z depth of every pixel.
  cv::Mat RenderDepth(const Frame& frame) const {
    cv::Mat depth_mu(camera_.height_px, camera_.width_px, CV_32FC1);
    const SE3<World, Camera>& pose = *frame.T_world_camera;
    for (int v = 0; v < depth_mu.rows; ++v) {
      for (int u = 0; u < depth_mu.cols; ++u) {
        const Eigen::Vector3d ray_world = pose.rotation() * camera_.Unproject(u, v);
        const double height_mu = frame.labels.at<uint16_t>(v, u) == kPlateLabel ? kPlateHeight_mu : 0;
        depth_mu.at<float>(v, u) = static_cast<float>((height_mu - pose.translation().z()) / ray_world.z());
      }
    }
    return depth_mu;
  }

  // Distance of a point to the nearest surface.
  static double DistanceToSurface_mu(const Eigen::Vector3d& p_world) {
    const double to_floor_mu = std::abs(p_world.z());
    const Eigen::Vector3d outside(std::max(0.0, std::abs(p_world.x()) - kPlateHalfSide_mu),
                                  std::max(0.0, std::abs(p_world.y()) - kPlateHalfSide_mu),
                                  p_world.z() - kPlateHeight_mu);
    return std::min(to_floor_mu, outside.norm());
  }

 private:
  // Blobs of several sizes, so that there are corners at every octave.
  static cv::Mat RandomTexture(int side_px, cv::RNG& random) {
    cv::Mat sum(side_px, side_px, CV_32FC1, cv::Scalar(0));
    for (const int cell_px : {3, 8, 20, 50}) {
      cv::Mat coarse(side_px / cell_px + 1, side_px / cell_px + 1, CV_32FC1), fine;
      random.fill(coarse, cv::RNG::UNIFORM, -1, 1);
      cv::resize(coarse, fine, sum.size(), 0, 0, cv::INTER_NEAREST);
      sum += fine;
    }
    cv::Mat texture;
    sum.convertTo(texture, CV_8U, 40, 128);
    cv::GaussianBlur(texture, texture, {3, 3}, 0);
    return texture;
  }

  // Texture pixels to image pixels, for a horizontal texture centered above the origin.
  cv::Matx33d FromTexture(const SE3<World, Camera>& T_world_camera, const cv::Mat& texture, double half_side_mu,
                          double height_mu) const {
    const double mu_per_px = 2 * half_side_mu / texture.cols;
    Eigen::Matrix3d world_from_texture;
    world_from_texture << mu_per_px, 0, -half_side_mu + 0.5 * mu_per_px,  //
        0, mu_per_px, -half_side_mu + 0.5 * mu_per_px,                    //
        0, 0, height_mu;
    const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
    Eigen::Matrix3d camera_from_texture = T_camera_world.RotationMatrix() * world_from_texture;
    camera_from_texture.col(2) += T_camera_world.translation();
    Eigen::Matrix3d K;
    K << camera_.fx_px, 0, camera_.cx_px, 0, camera_.fy_px, camera_.cy_px, 0, 0, 1;
    const Eigen::Matrix3d H = K * camera_from_texture;
    return {H(0, 0), H(0, 1), H(0, 2), H(1, 0), H(1, 1), H(1, 2), H(2, 0), H(2, 1), H(2, 2)};
  }

  CameraModel camera_;
  cv::Mat floor_;
  cv::Mat plate_;
};

}  // namespace romap::slam
