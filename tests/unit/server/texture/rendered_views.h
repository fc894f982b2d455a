#pragma once

// Photos of objects with a known shape and color, and of textured meshes.

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "common/stage_messages.h"
#include "server/texture/bake_texture.h"
#include "server/texture/texture_view.h"

namespace romap::texture {

// Color at a point of the surface: blue, green, red in gray levels.
using SolidTexture = std::function<Eigen::Array3d(const Eigen::Vector3d&)>;
// The distance along a ray (origin, direction) to the surface, in units of the direction.
using SolidShape = std::function<std::optional<double>(const Eigen::Vector3d&, const Eigen::Vector3d&)>;

inline SolidShape SolidSphere() {
  return [](const Eigen::Vector3d& origin, const Eigen::Vector3d& d) -> std::optional<double> {
    const double a = d.squaredNorm(), b = origin.dot(d), c = origin.squaredNorm() - 1;
    const double root = b * b - a * c;
    if (root < 0) return std::nullopt;
    return (-b - std::sqrt(root)) / a;
  };
}

inline SolidShape SolidBox(const Eigen::Vector3d& half_extents) {
  return [half_extents](const Eigen::Vector3d& origin, const Eigen::Vector3d& d) -> std::optional<double> {
    double enter = -1e9, leave = 1e9;
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (-half_extents[axis] - origin[axis]) / d[axis],
                   b = (half_extents[axis] - origin[axis]) / d[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    if (enter > leave) return std::nullopt;
    return enter;
  };
}

// Cells of a checkerboard in space, with stripes of other colors.
inline SolidTexture Checker(double cells_per_mu = 4.3) {
  return [=](const Eigen::Vector3d& p) {
    const auto cell = [&](double x) { return static_cast<int>(std::floor(x * cells_per_mu + 0.37)); };
    const bool is_odd = (cell(p.x()) + cell(p.y()) + cell(p.z())) % 2 != 0;
    const double stripe = 0.5 + 0.5 * std::sin(9 * cells_per_mu * (p.x() + 0.5 * p.y() - 0.7 * p.z()) / 3);
    const double brightness = (is_odd ? 60 : 150) + 60 * stripe;
    return Eigen::Array3d(brightness - 20, brightness, brightness + 25 * stripe);
  };
}

inline CameraModel TestCamera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 400, .fy_px = 400, .cx_px = 320, .cy_px = 240};
}

// A camera at a position that looks at the origin, upright.
inline SE3<Camera, Object> LookAtOrigin(const Eigen::Vector3d& position) {
  const Eigen::Vector3d forward = -position.normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  return {R, -(R * position)};
}

// Positions around an object, on a spiral from low to high. `phase` in turns.
inline std::vector<SE3<Camera, Object>> PosesAround(int count, double distance_mu, double phase,
                                                    double lowest_z = -0.75) {
  std::vector<SE3<Camera, Object>> poses;
  for (int i = 0; i < count; ++i) {
    const double z = lowest_z + (0.9 - lowest_z) * (i + 0.5) / count;
    const double angle = 2 * std::numbers::pi * (phase + 0.618034 * i), r = std::sqrt(1 - z * z);
    // Different distances, as of a camera that is held by hand.
    const double distance = distance_mu * (1 + 0.08 * std::sin(3.0 * i + phase));
    poses.push_back(LookAtOrigin(distance * Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z)));
  }
  return poses;
}

inline constexpr int kCrop_px = 200;

// A view with 200 x 200 px; each pixel is the mean of 3 x 3 rays.
inline TrainingCamera Photograph(const SE3<Camera, Object>& T_camera_object, const SolidShape& shape,
                                 const SolidTexture& color) {
  TrainingCamera view{T_camera_object, TestCamera(), cv::Rect(220, 140, kCrop_px, kCrop_px), {}, {}};
  view.color_bgr.create(kCrop_px, kCrop_px, CV_8UC3);
  view.ray_kind.create(kCrop_px, kCrop_px, CV_8UC1);
  const SE3<Object, Camera> T_object_camera = T_camera_object.Inverse();
  const Eigen::Matrix3d R = T_object_camera.RotationMatrix();
  const Eigen::Vector3d origin = T_object_camera.translation();
  for (int y = 0; y < kCrop_px; ++y) {
    for (int x = 0; x < kCrop_px; ++x) {
      Eigen::Array3d sum = Eigen::Array3d::Zero();
      int hits = 0;
      for (int sample = 0; sample < 9; ++sample) {
        const double u = view.roi_px.x + x + (sample % 3 - 1) / 3.0, v = view.roi_px.y + y + (sample / 3 - 1) / 3.0;
        const Eigen::Vector3d direction = R * view.camera.Unproject(u, v);
        const std::optional<double> distance = shape(origin, direction);
        sum += distance.has_value() ? color(origin + *distance * direction) : Eigen::Array3d(20, 200, 30);
        hits += distance.has_value();
      }
      for (int c = 0; c < 3; ++c) view.color_bgr.at<cv::Vec3b>(y, x)[c] = static_cast<uint8_t>(sum[c] / 9 + 0.5);
      view.ray_kind.at<uint8_t>(y, x) = static_cast<uint8_t>(hits > 4 ? RayKind::kObject : RayKind::kBackground);
    }
  }
  return view;
}

inline std::vector<TrainingCamera> PhotographAll(const std::vector<SE3<Camera, Object>>& poses, const SolidShape& shape,
                                                 const SolidTexture& color) {
  std::vector<TrainingCamera> views;
  for (const auto& pose : poses) views.push_back(Photograph(pose, shape, color));
  return views;
}

// Bilinear interpolation as in a renderer, at texture coordinates (see TexturedMesh).
inline Eigen::Array3d TextureAt(const cv::Mat& texture_bgr, const Eigen::Vector2d& uv) {
  const double x = std::clamp(uv.x() * texture_bgr.cols - 0.5, 0.0, texture_bgr.cols - 1.001);
  const double y = std::clamp(uv.y() * texture_bgr.rows - 0.5, 0.0, texture_bgr.rows - 1.001);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  Eigen::Array3d color = Eigen::Array3d::Zero();
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      const double weight = (dx == 0 ? 1 - (x - x0) : x - x0) * (dy == 0 ? 1 - (y - y0) : y - y0);
      const cv::Vec3b& texel = texture_bgr.at<cv::Vec3b>(y0 + dy, x0 + dx);
      color += weight * Eigen::Array3d(texel[0], texel[1], texel[2]);
    }
  }
  return color;
}

// The color at a point of a triangle, from its index and barycentric coordinates.
using MeshColor = std::function<Eigen::Array3d(size_t, const Eigen::Vector3d&)>;

inline MeshColor ColorOfTexture(const TexturedMesh& textured, const cv::Mat& texture_bgr) {
  return [&textured, texture_bgr](size_t face, const Eigen::Vector3d& barycentric) {
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
    for (int i = 0; i < 3; ++i)
      uv += barycentric[i] * textured.mesh.uv[textured.mesh.triangles[face][i]].cast<double>();
    return TextureAt(texture_bgr, uv);
  };
}

// Colors of the vertices, interpolated.
inline MeshColor ColorOfVertices(const Mesh& mesh, const SolidTexture& color) {
  return [&mesh, color](size_t face, const Eigen::Vector3d& barycentric) {
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    for (int i = 0; i < 3; ++i) sum += barycentric[i] * color(mesh.vertices[mesh.triangles[face][i]].cast<double>());
    return sum;
  };
}

// Renders a mesh from the pose of a view, with 3 x 3 samples per pixel. CV_32FC3; NaN where no sample hits.
inline cv::Mat RenderMesh(const Mesh& mesh, const TrainingCamera& view, const MeshColor& color) {
  constexpr int kSamples = 3, kSide = kCrop_px * kSamples;
  std::vector<double> nearest(kSide * kSide, std::numeric_limits<double>::infinity());
  std::vector<std::pair<size_t, Eigen::Vector3d>> hit(nearest.size());
  for (size_t face = 0; face < mesh.triangles.size(); ++face) {
    std::array<Eigen::Vector2d, 3> p;
    std::array<double, 3> z;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d q = view.T_camera_object * mesh.vertices[mesh.triangles[face][i]].cast<double>();
      z[i] = q.z();
      p[i] = (view.camera.Project(q) - Eigen::Vector2d(view.roi_px.x - 1 / 3.0, view.roi_px.y - 1 / 3.0)) * kSamples;
    }
    const Eigen::Vector2d u = p[1] - p[0], v = p[2] - p[0];
    const double determinant = u.x() * v.y() - u.y() * v.x();
    if (determinant == 0) continue;
    const Eigen::Vector2d low = p[0].cwiseMin(p[1]).cwiseMin(p[2]), high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
    for (int y = std::max(0, static_cast<int>(std::ceil(low.y()))); y <= std::min<double>(high.y(), kSide - 1); ++y) {
      for (int x = std::max(0, static_cast<int>(std::ceil(low.x()))); x <= std::min<double>(high.x(), kSide - 1); ++x) {
        const Eigen::Vector2d d = Eigen::Vector2d(x, y) - p[0];
        const double b = (d.x() * v.y() - d.y() * v.x()) / determinant,
                     c = (u.x() * d.y() - u.y() * d.x()) / determinant;
        if (b < 0 || c < 0 || b + c > 1) continue;
        Eigen::Vector3d barycentric((1 - b - c) / z[0], b / z[1], c / z[2]);  // correct in perspective
        const double depth = 1 / barycentric.sum();
        const auto at = static_cast<size_t>(y * kSide + x);
        if (depth >= nearest[at]) continue;
        nearest[at] = depth;
        hit[at] = {face, barycentric * depth};
      }
    }
  }
  cv::Mat image(kCrop_px, kCrop_px, CV_32FC3, cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()));
  for (int y = 0; y < kCrop_px; ++y) {
    for (int x = 0; x < kCrop_px; ++x) {
      Eigen::Array3d sum = Eigen::Array3d::Zero();
      int hits = 0;
      for (int sample = 0; sample < kSamples * kSamples; ++sample) {
        const auto at =
            static_cast<size_t>((kSamples * y + sample / kSamples) * kSide + kSamples * x + sample % kSamples);
        if (std::isinf(nearest[at])) continue;
        sum += color(hit[at].first, hit[at].second);
        ++hits;
      }
      if (hits > 0) image.at<cv::Vec3f>(y, x) = cv::Vec3f(sum[0] / hits, sum[1] / hits, sum[2] / hits);
    }
  }
  return image;
}

// Over all pixels of the object that the mesh covers, except those at the border of the mask.
inline double PsnrOfViews(const Mesh& mesh, const MeshColor& color, const std::vector<TrainingCamera>& views) {
  double sum = 0;
  size_t count = 0;
  for (const TrainingCamera& view : views) {
    const cv::Mat image = RenderMesh(mesh, view, color);
    for (int y = 1; y + 1 < image.rows; ++y) {
      for (int x = 1; x + 1 < image.cols; ++x) {
        bool is_inside = true;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            is_inside &= view.ray_kind.at<uint8_t>(y + dy, x + dx) == static_cast<uint8_t>(RayKind::kObject);
          }
        }
        if (!is_inside || std::isnan(image.at<cv::Vec3f>(y, x)[0])) continue;
        for (int c = 0; c < 3; ++c) {
          const double error = image.at<cv::Vec3f>(y, x)[c] - view.color_bgr.at<cv::Vec3b>(y, x)[c];
          sum += error * error;
          ++count;
        }
      }
    }
  }
  return 10 * std::log10(255 * 255 * static_cast<double>(count) / sum);
}

}  // namespace romap::texture
