#include "client/synth/overlays.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "client/synth/material.h"
#include "client/synth/noise.h"
#include "client/synth/random.h"
#include "client/synth/shading.h"

namespace romap::synth {
namespace {

constexpr double kGripperDepth_m = 0.15;
constexpr double kOccluderDepth_m = 0.3;
constexpr double kCrossing_s = 4;

// An evenly lit sheet of a material that fills the width of the image with 0.3 m.
cv::Mat PaintSheet(cv::Size size, int image_width_px, const Material& material) {
  cv::Mat sheet(size, CV_8UC3);
  const float pixel_m = 0.3F / static_cast<float>(image_width_px);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      const Eigen::Vector3f p_m(pixel_m * static_cast<float>(u), pixel_m * static_cast<float>(v), 0.01F);
      const Rgb color = 0.7F * Albedo(material, p_m, Eigen::Vector3f::UnitZ(), pixel_m);
      sheet.at<cv::Vec3b>(v, u) = {ToSrgb8(color.z()), ToSrgb8(color.y()), ToSrgb8(color.x())};
    }
  }
  return sheet;
}

// The `share` of all pixels that belong to a palm with two fingers at the lower image border.
cv::Mat GripperMask(cv::Size size, double share) {
  // Height above the lower border relative to the outline of the gripper; its quantile gives the requested share.
  std::vector<float> height;
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      const double across = std::abs(2.0 * (u + 0.5) / size.width - 1);  // 0 at the center, 1 at the sides
      const double up = 1 - (v + 0.5) / size.height;
      const double outline =
          0.25 * std::exp(-std::pow(across / 0.6, 4)) + std::exp(-std::pow((across - 0.4) / 0.14, 4));
      height.push_back(static_cast<float>(up / (outline + 1e-3)));
    }
  }
  std::vector<float> sorted = height;
  const auto count = static_cast<size_t>(std::lround(share * static_cast<double>(sorted.size())));
  cv::Mat mask(size, CV_8UC1, cv::Scalar(255));
  if (count >= sorted.size()) return mask;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count), sorted.end());
  const cv::Mat heights(size, CV_32FC1, height.data());
  return heights < sorted[count];
}

}  // namespace

Overlays::Overlays(const SynthOptions& options, const CameraModel& camera) {
  Random random(options.seed, 9);
  const cv::Size size(camera.width_px, camera.height_px);
  constexpr Pattern kPatterns[] = {Pattern::kSpeckle, Pattern::kPrint, Pattern::kTiles, Pattern::kFabric};
  const auto material = [&] { return RandomMaterial(kPatterns[random.Below(4)], 0.02F, random); };
  const Material gripper = material();
  const Material occluder = material();
  if (options.gripper_share > 0) {
    gripper_ = GripperMask(size, options.gripper_share);
    gripper_bgr_ = PaintSheet(size, size.width, gripper);
  }
  if (options.occluder_share <= 0) return;
  occluder_radius_px_ = std::sqrt(options.occluder_share * size.area() / std::numbers::pi);
  half_length_px_ = 0.5 * std::hypot(size.width, size.height) + 1.4 * occluder_radius_px_;
  frames_per_crossing_ = kCrossing_s * options.fps;
  const auto outline_seed = static_cast<uint32_t>(random.Bits());
  for (int i = 0; i < 360; ++i) {
    const auto angle = static_cast<float>(2 * std::numbers::pi * i / 360);
    outline_.push_back(1 +
                       0.25 * FractalNoise({std::cos(angle), std::sin(angle), 0.3F}, 1, 3, 0.5F, 1e-6F, outline_seed));
  }
  const int side_px = 2 * static_cast<int>(std::ceil(1.5 * occluder_radius_px_)) + 1;
  occluder_bgr_ = PaintSheet({side_px, side_px}, size.width, occluder);
  const int crossings = static_cast<int>(options.frames / frames_per_crossing_) + 1;
  for (int i = 0; i < crossings; ++i) {
    const double angle = random.Uniform(0, 2 * std::numbers::pi);
    const cv::Point2d direction(std::cos(angle), std::sin(angle));
    const double beside_px = random.Uniform(-0.2, 0.2) * size.height;
    const cv::Point2d center_px(0.5 * size.width, 0.5 * size.height);
    crossings_.push_back({center_px + beside_px * cv::Point2d(-direction.y, direction.x), direction});
  }
}

void Overlays::DrawOccluder(int frame, TrueFrame& image) const {
  const double time = frame / frames_per_crossing_;
  const auto& [middle_px, direction] = crossings_[static_cast<size_t>(time)];
  const double along_px = half_length_px_ * (2 * (time - std::floor(time)) - 1);
  const cv::Point2d center_px = middle_px + along_px * direction;
  const cv::Point corner(static_cast<int>(std::lround(center_px.x)) - occluder_bgr_.cols / 2,
                         static_cast<int>(std::lround(center_px.y)) - occluder_bgr_.rows / 2);
  const cv::Rect visible = cv::Rect(corner, occluder_bgr_.size()) & cv::Rect({}, image.labels.size());
  for (int v = visible.y; v < visible.br().y; ++v) {
    for (int u = visible.x; u < visible.br().x; ++u) {
      const double angle = std::atan2(v - center_px.y, u - center_px.x);
      const auto bin = static_cast<size_t>((angle / (2 * std::numbers::pi) + 1) * 360) % 360;
      if (std::hypot(u - center_px.x, v - center_px.y) > occluder_radius_px_ * outline_[bin]) continue;
      image.color_bgr.at<cv::Vec3b>(v, u) = occluder_bgr_.at<cv::Vec3b>(v - corner.y, u - corner.x);
      image.labels.at<uint8_t>(v, u) = 0;
      image.depth_m.at<float>(v, u) = kOccluderDepth_m;
    }
  }
}

void Overlays::Apply(int frame, TrueFrame& image) const {
  if (occluder_radius_px_ > 0) DrawOccluder(frame, image);
  if (gripper_.empty()) return;
  gripper_bgr_.copyTo(image.color_bgr, gripper_);
  image.labels.setTo(0, gripper_);
  image.depth_m.setTo(kGripperDepth_m, gripper_);
}

}  // namespace romap::synth
