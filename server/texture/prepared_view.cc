#include "server/texture/prepared_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/stage_messages.h"

namespace romap::texture {
namespace {

constexpr float kMinCosine = 0.22f;  // 77 degrees
// Pixels at the border of a mask mix the object with its background.
constexpr float kInsideMask_px = 2.0f;
// The weight increases over this distance from the border of the visible region, so that no seam is visible there.
constexpr float kFeather_px = 6.0f;
// An edge in front of another surface: the depth differs by this many pixel sizes from that of a plane through the
// neighbors. For a round surface that is viewed at 77 degrees, it differs by about 2 pixel sizes.
constexpr float kDepthStep_px = 4.0f;
// A point is hidden if it is behind the nearest depth by this many pixel sizes, in addition to the slope of its own
// surface.
constexpr float kHidden_px = 1.5f;
constexpr float kHiddenSlope_px = 2.0f;
// Factor between the resolutions of the image and of its low frequencies.
constexpr int kLowStep_px = 4;
// Triangles that are nearer to the camera than this share of the mesh's extent are not rendered.
constexpr float kNear = 1e-3f;
constexpr float kFarPixel = 1e5f;

// A pixel that triangle corners project to, with inverse depth, which is linear in the image.
struct RenderedCorner {
  float u, v, inverse_depth;
  bool is_valid;
};

void RenderTriangle(const RenderedCorner& a, const RenderedCorner& b, const RenderedCorner& c, cv::Mat& inverse_depth) {
  const int x0 = std::max(static_cast<int>(std::ceil(std::min({a.u, b.u, c.u}))), 0);
  const int y0 = std::max(static_cast<int>(std::ceil(std::min({a.v, b.v, c.v}))), 0);
  const int x1 = std::min(static_cast<int>(std::floor(std::max({a.u, b.u, c.u}))), inverse_depth.cols - 1);
  const int y1 = std::min(static_cast<int>(std::floor(std::max({a.v, b.v, c.v}))), inverse_depth.rows - 1);
  if (x0 > x1 || y0 > y1) return;
  const float determinant = (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
  if (determinant == 0) return;
  const float b_x = (c.v - a.v) / determinant, b_y = -(c.u - a.u) / determinant;
  const float c_x = -(b.v - a.v) / determinant, c_y = (b.u - a.u) / determinant;
  for (int y = y0; y <= y1; ++y) {
    auto* row = inverse_depth.ptr<float>(y);
    const float dy = static_cast<float>(y) - a.v;
    for (int x = x0; x <= x1; ++x) {
      const float dx = static_cast<float>(x) - a.u;
      const float of_b = b_x * dx + b_y * dy, of_c = c_x * dx + c_y * dy;
      if (of_b < 0 || of_c < 0 || of_b + of_c > 1) continue;
      const float value =
          a.inverse_depth + of_b * (b.inverse_depth - a.inverse_depth) + of_c * (c.inverse_depth - a.inverse_depth);
      row[x] = std::max(row[x], value);
    }
  }
}

// The mean of an image over the mask (255 or 0) at low resolution, smoothed.
cv::Mat MaskedMean(const cv::Mat& masked, const cv::Mat& low_mask) {
  cv::Mat low;
  cv::resize(masked, low, low_mask.size(), 0, 0, cv::INTER_AREA);
  cv::blur(low, low, {3, 3});
  cv::blur(low, low, {3, 3});
  const int channels = low.channels();
  for (int y = 0; y < low.rows; ++y) {
    auto* row = low.ptr<float>(y);
    const auto* mask = low_mask.ptr<float>(y);
    for (int x = 0; x < low.cols * channels; ++x) row[x] /= std::max(mask[x / channels], 1e-4f);
  }
  return low;
}

}  // namespace

PreparedView::PreparedView(const TrainingCamera& view, const Mesh& mesh)
    : R_camera_object_(view.T_camera_object.RotationMatrix().cast<float>()),
      t_camera_object_(view.T_camera_object.translation().cast<float>()),
      center_(view.T_camera_object.Inverse().translation().cast<float>()),
      focal_px_(static_cast<float>(view.camera.fx_px), static_cast<float>(view.camera.fy_px)),
      principal_px_(static_cast<float>(view.camera.cx_px - view.roi_px.x),
                    static_cast<float>(view.camera.cy_px - view.roi_px.y)),
      color_bgr_(view.color_bgr) {
  RenderDepth(mesh);
  FindVisibleRegion(view.ray_kind);
  FilterImage();
}

Eigen::Vector3f PreparedView::Project(const Eigen::Vector3f& position) const {
  const Eigen::Vector3f p = R_camera_object_ * position + t_camera_object_;
  const float per_depth = 1 / p.z();
  return {focal_px_.x() * p.x() * per_depth + principal_px_.x(), focal_px_.y() * p.y() * per_depth + principal_px_.y(),
          p.z()};
}

void PreparedView::RenderDepth(const Mesh& mesh) {
  inverse_depth_ = cv::Mat::zeros(color_bgr_.size(), CV_32FC1);
  std::vector<RenderedCorner> corners;
  corners.reserve(mesh.vertices.size());
  float extent_mu = 0;
  for (const Eigen::Vector3f& p : mesh.vertices) extent_mu = std::max(extent_mu, (p - mesh.vertices[0]).norm());
  for (const Eigen::Vector3f& p : mesh.vertices) {
    const Eigen::Vector3f pixel = Project(p);
    const bool is_valid =
        pixel.z() > kNear * extent_mu && std::abs(pixel.x()) < kFarPixel && std::abs(pixel.y()) < kFarPixel;
    corners.push_back({pixel.x(), pixel.y(), 1 / pixel.z(), is_valid});
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    if (!corners[a].is_valid || !corners[b].is_valid || !corners[c].is_valid) continue;
    RenderTriangle(corners[a], corners[b], corners[c], inverse_depth_);
  }
}

void PreparedView::FindVisibleRegion(const cv::Mat& ray_kind) {
  cv::Mat is_object, distance_px;
  cv::compare(ray_kind, static_cast<int>(RayKind::kObject), is_object, cv::CMP_EQ);
  cv::distanceTransform(is_object, distance_px, cv::DIST_L2, 3);
  cv::compare(distance_px, kInsideMask_px, inside_, cv::CMP_GE);

  cv::Mat largest;
  cv::dilate(inverse_depth_, largest, cv::Mat::ones(3, 3, CV_8UC1));
  nearest_depth_mu_ = 1 / largest;
  const float pixel_size = 1 / focal_px_.minCoeff();  // at depth 1
  for (int y = 1; y + 1 < is_object.rows; ++y) {
    const auto *above = inverse_depth_.ptr<float>(y - 1), *row = inverse_depth_.ptr<float>(y),
               *below = inverse_depth_.ptr<float>(y + 1);
    for (int x = 1; x + 1 < is_object.cols; ++x) {
      // The inverse depth of a plane is linear in the image. Where there is no surface, it is 0, which is not an edge.
      const float limit = kDepthStep_px * pixel_size * row[x];
      const auto is_step = [&](float before, float after) {
        return before > 0 && after > 0 && std::abs(before - 2 * row[x] + after) > limit;
      };
      if (row[x] > 0 && (is_step(row[x - 1], row[x + 1]) || is_step(above[x], below[x]))) {
        is_object.at<uint8_t>(y, x) = 0;
      }
    }
  }
  cv::distanceTransform(is_object, distance_px, cv::DIST_L2, 3);
  feather_.create(is_object.size(), CV_8UC1);
  for (int y = 0; y < is_object.rows; ++y) {
    for (int x = 0; x < is_object.cols; ++x) {
      const float inside_px = distance_px.at<float>(y, x) - kInsideMask_px;
      const float feather = std::clamp((inside_px + 0.5f) / kFeather_px, 0.0f, 1.0f);
      feather_.at<uint8_t>(y, x) = inside_px < 0 ? 0 : static_cast<uint8_t>(255 * feather);
    }
  }
}

void PreparedView::FilterImage() {
  const cv::Size low_size((inside_.cols + kLowStep_px - 1) / kLowStep_px,
                          (inside_.rows + kLowStep_px - 1) / kLowStep_px);
  cv::Mat mask, low_mask;
  inside_.convertTo(mask, CV_32F, 1.0 / 255);
  cv::resize(mask, low_mask, low_size, 0, 0, cv::INTER_AREA);
  cv::blur(low_mask, low_mask, {3, 3});
  cv::blur(low_mask, low_mask, {3, 3});

  cv::Mat masked;
  color_bgr_.convertTo(masked, CV_32F);
  masked.setTo(cv::Scalar::all(0), inside_ == 0);
  low_bgr_ = MaskedMean(masked, low_mask);

  cv::Mat gray, laplacian, energy;
  cv::cvtColor(color_bgr_, gray, cv::COLOR_BGR2GRAY);
  cv::Laplacian(gray, laplacian, CV_32F);
  energy = laplacian.mul(laplacian);
  energy.setTo(0, inside_ == 0);
  low_energy_ = MaskedMean(energy, low_mask);
}

template <int c>
Eigen::Array<float, c, 1> PreparedView::LookUpLow(const cv::Mat& low, const ViewedPoint& point) const {
  const float x = (point.u_px + 0.5f) * static_cast<float>(low.cols) / static_cast<float>(color_bgr_.cols) - 0.5f;
  const float y = (point.v_px + 0.5f) * static_cast<float>(low.rows) / static_cast<float>(color_bgr_.rows) - 0.5f;
  const int x0 = std::clamp(static_cast<int>(x), 0, std::max(low.cols - 2, 0));
  const int y0 = std::clamp(static_cast<int>(y), 0, std::max(low.rows - 2, 0));
  const float dx = std::clamp(x - static_cast<float>(x0), 0.0f, 1.0f);
  const float dy = std::clamp(y - static_cast<float>(y0), 0.0f, 1.0f);
  const int right = x0 + 1 < low.cols ? c : 0;
  const float* upper = low.ptr<float>(y0) + c * x0;
  const float* lower = y0 + 1 < low.rows ? low.ptr<float>(y0 + 1) + c * x0 : upper;
  using Values = Eigen::Map<const Eigen::Array<float, c, 1>>;
  return (1 - dy) * ((1 - dx) * Values(upper) + dx * Values(upper + right)) +
         dy * ((1 - dx) * Values(lower) + dx * Values(lower + right));
}

ViewedPoint PreparedView::Find(const Eigen::Vector3f& position, const Eigen::Vector3f& normal) const {
  ViewedPoint point;
  const Eigen::Vector3f to_camera = center_ - position;
  const float toward = normal.dot(to_camera);
  if (!(toward > 0)) return point;
  const float cosine_squared = toward * toward / to_camera.squaredNorm();
  if (cosine_squared < kMinCosine * kMinCosine) return point;
  const Eigen::Vector3f pixel = Project(position);
  if (!(pixel.z() > 0 && pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < static_cast<float>(color_bgr_.cols - 1) &&
        pixel.y() < static_cast<float>(color_bgr_.rows - 1))) {
    return point;
  }
  const int near_u = static_cast<int>(pixel.x() + 0.5f), near_v = static_cast<int>(pixel.y() + 0.5f);
  const uint8_t feather = feather_.ptr<uint8_t>(near_v)[near_u];
  if (feather == 0) return point;
  point.resolution = focal_px_.mean() / pixel.z();
  const float slope = std::sqrt(std::max(1 - cosine_squared, 0.0f) / cosine_squared);
  const float behind_px = (pixel.z() - nearest_depth_mu_.ptr<float>(near_v)[near_u]) * point.resolution;
  if (behind_px > kHidden_px + kHiddenSlope_px * slope) return point;
  point.weight = cosine_squared * point.resolution * static_cast<float>(feather) / 255;
  point.u_px = pixel.x();
  point.v_px = pixel.y();
  return point;
}

std::optional<Eigen::Array3f> PreparedView::DetailAt(const Eigen::Vector3f& position) const {
  const Eigen::Vector3f pixel = Project(position);
  if (!(pixel.z() > 0 && pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < static_cast<float>(color_bgr_.cols - 1) &&
        pixel.y() < static_cast<float>(color_bgr_.rows - 1))) {
    return std::nullopt;
  }
  if (inside_.ptr<uint8_t>(static_cast<int>(pixel.y() + 0.5f))[static_cast<int>(pixel.x() + 0.5f)] == 0) {
    return std::nullopt;
  }
  const ViewSample sample = Sample({.weight = 1, .u_px = pixel.x(), .v_px = pixel.y()});
  return sample.color_bgr - sample.low_bgr;
}

ViewSample PreparedView::Sample(const ViewedPoint& point) const {
  ViewSample sample;
  sample.weight = point.weight;
  const int u0 = static_cast<int>(point.u_px), v0 = static_cast<int>(point.v_px);
  const float du = point.u_px - static_cast<float>(u0), dv = point.v_px - static_cast<float>(v0);
  const uint8_t* upper = color_bgr_.ptr<uint8_t>(v0) + 3 * u0;
  const uint8_t* lower = color_bgr_.ptr<uint8_t>(v0 + 1) + 3 * u0;
  for (int c = 0; c < 3; ++c) {
    const float above = static_cast<float>(upper[c]) + du * static_cast<float>(upper[c + 3] - upper[c]);
    const float below = static_cast<float>(lower[c]) + du * static_cast<float>(lower[c + 3] - lower[c]);
    sample.color_bgr[c] = above + dv * (below - above);
  }
  sample.low_bgr = LookUpLow<3>(low_bgr_, point);
  return sample;
}

float PreparedView::SharpnessAt(const ViewedPoint& point) const {
  // The Laplacian of a fine pattern decreases with the square of the resolution, that of an edge does not depend on it.
  return LookUpLow<1>(low_energy_, point)[0] * point.resolution * point.resolution;
}

}  // namespace romap::texture
