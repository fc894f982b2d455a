#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/field_snapshot.h"
#include "common/stage_messages.h"

namespace romap::mesh {

// Signed distance to a surface in map units at a point of the Object frame, positive inside.
using InsideDistance = std::function<float(const Eigen::Vector3f&)>;

// A field whose raw value is proportional to a signed distance: raw = level + slope * distance. Its color is the
// position: 0..255 over the box on each axis.
class DistanceField : public FieldSampler {
 public:
  DistanceField(InsideDistance distance, float level, float slope_per_mu, const Eigen::Vector3f& box_half_extents)
      : distance_(std::move(distance)), level_(level), slope_per_mu_(slope_per_mu), box_(box_half_extents) {}

  static Rgb8 ColorAt(const Eigen::Vector3f& p, const Eigen::Vector3f& box) {
    const Eigen::Array3f unit = ((p.array() / box.array() + 1.0f) * 127.5f).max(0.0f).min(255.0f);
    return {static_cast<uint8_t>(unit.x()), static_cast<uint8_t>(unit.y()), static_cast<uint8_t>(unit.z())};
  }

  void Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const override {
    for (size_t i = 0; i < p_object.size(); ++i) {
      raw[i] = level_ + slope_per_mu_ * distance_(p_object[i]);
      if (!rgb.empty()) rgb[i] = ColorAt(p_object[i], box_);
    }
  }

 private:
  InsideDistance distance_;
  float level_;
  float slope_per_mu_;
  Eigen::Vector3f box_;
};

inline constexpr float kTestLevel = 3.0f;

// A view of 400 x 400 px from `center` (Object frame) toward the origin, all pixels of which show the object.
inline TrainingCamera ViewFrom(const Eigen::Vector3d& center) {
  TrainingCamera view;
  const Eigen::Quaterniond turn = ShortestRotation(-center, Eigen::Vector3d::UnitZ());
  view.T_camera_object = {turn, -(turn * center)};
  view.camera = {.width_px = 400, .height_px = 400, .fx_px = 400, .fy_px = 400, .cx_px = 199.5, .cy_px = 199.5};
  view.roi_px = {0, 0, 400, 400};
  view.ray_kind = cv::Mat(400, 400, CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kObject)));
  return view;
}

// A snapshot of object/3 over the box, without views and without a hull. Raw changes by 60 over the longest half
// extent, at least as fast as in a trained field.
inline FieldSnapshot SnapshotOf(InsideDistance distance,
                                const Eigen::Vector3f& box_half_extents = Eigen::Vector3f::Ones()) {
  FieldSnapshot snapshot;
  snapshot.object = ObjectId{3};
  snapshot.box_half_extents = box_half_extents;
  snapshot.surface_level = kTestLevel;
  snapshot.connect_level = kTestLevel - 2.0f;
  snapshot.optics = {std::exp(kTestLevel) / (2.0f * box_half_extents.maxCoeff()), 1.0f};
  snapshot.field = std::make_shared<DistanceField>(std::move(distance), kTestLevel, 60.0f / box_half_extents.maxCoeff(),
                                                   box_half_extents);
  return snapshot;
}

inline InsideDistance Sphere(float radius, const Eigen::Vector3f& center = Eigen::Vector3f::Zero()) {
  return [=](const Eigen::Vector3f& p) { return radius - (p - center).norm(); };
}

// Torus around z.
inline InsideDistance Torus(float ring_radius, float tube_radius) {
  return [=](const Eigen::Vector3f& p) { return tube_radius - std::hypot(p.head<2>().norm() - ring_radius, p.z()); };
}

// Cylinder along x between two points of the x axis, with round ends.
inline InsideDistance Stem(float from_x, float to_x, float radius) {
  return [=](const Eigen::Vector3f& p) {
    return radius - (p - Eigen::Vector3f(std::clamp(p.x(), from_x, to_x), 0, 0)).norm();
  };
}

inline InsideDistance Union(std::vector<InsideDistance> parts) {
  return [parts = std::move(parts)](const Eigen::Vector3f& p) {
    float distance = -std::numeric_limits<float>::infinity();
    for (const InsideDistance& part : parts) distance = std::max(distance, part(p));
    return distance;
  };
}

}  // namespace romap::mesh
