#include "server/nerf/view_alignment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/statistics.h"
#include "server/nerf/math/random.h"

namespace romap::nerf {
namespace {

constexpr int kReach_px = 5;           // half width of the band around the outline that is compared
constexpr double kSmoothing_px = 1.5;  // image gradients must extend as far as the pose errors
constexpr int kCropBorder_px = 2;      // of the crop, where no gradients are computed
constexpr int kIterations = 4;
constexpr float kMinOpacity = 0.5f;  // of pixels whose color is compared
constexpr size_t kMinOpaquePixels = 10;

// Weight of the pixels relative to the prior. Small, because errors of neighboring pixels are correlated and the field
// itself is inaccurate.
constexpr double kInformation = 0.05;

constexpr double kInitialColorScale = 0.1;  // before the scale of the errors is estimated
constexpr double kMinColorScale = 0.02;
constexpr double kMinOutlineScale = 0.1;

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Quaterniond Turn(const Eigen::Vector3d& turn_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad.norm(), turn_rad.stableNormalized()));
}

// Bilinear interpolation; channels 0..1. (x, y) must be inside the image, and not in its last row or column.
template <size_t kChannels>
Eigen::Array<double, kChannels, 1> Interpolate(const cv::Mat& image, double x, double y) {
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const double right = x - x0, low = y - y0;
  const uint8_t* upper = image.ptr<uint8_t>(y0) + static_cast<size_t>(x0) * kChannels;
  const uint8_t* lower = image.ptr<uint8_t>(y0 + 1) + static_cast<size_t>(x0) * kChannels;
  Eigen::Array<double, kChannels, 1> values;
  for (size_t c = 0; c < kChannels; ++c) {
    const double above = upper[c] + right * (upper[c + kChannels] - upper[c]);
    const double below = lower[c] + right * (lower[c + kChannels] - lower[c]);
    values[static_cast<Eigen::Index>(c)] = (above + low * (below - above)) / 255;
  }
  return values;
}

// Rows: channels; columns: x, y; per pixel.
template <size_t kChannels>
Eigen::Matrix<double, kChannels, 2> Gradient(const cv::Mat& image, const Eigen::Vector2d& at) {
  Eigen::Matrix<double, kChannels, 2> gradient;
  gradient.col(0) =
      0.5 * (Interpolate<kChannels>(image, at.x() + 1, at.y()) - Interpolate<kChannels>(image, at.x() - 1, at.y()));
  gradient.col(1) =
      0.5 * (Interpolate<kChannels>(image, at.x(), at.y() + 1) - Interpolate<kChannels>(image, at.x(), at.y() - 1));
  return gradient;
}

// Appends up to `count` evenly spaced elements of `all`. `offset`, 0..1, shifts the choice by that share of the
// spacing.
void AppendEvenlySpaced(const std::vector<cv::Point>& all, size_t count, double offset,
                        std::vector<cv::Point>& chosen) {
  count = std::min(count, all.size());
  const double spacing = static_cast<double>(all.size()) / static_cast<double>(std::max<size_t>(1, count));
  for (size_t i = 0; i < count; ++i) {
    chosen.push_back(all[std::min(all.size() - 1, static_cast<size_t>((static_cast<double>(i) + offset) * spacing))]);
  }
}

}  // namespace

SE3<Camera, Object> Moved(const SE3<Camera, Object>& T_camera_object, const ObjectMotion& motion) {
  return {Turn(motion.head<3>()) * T_camera_object.rotation(), T_camera_object.translation() + motion.tail<3>()};
}

ObjectMotion MotionBetween(const SE3<Camera, Object>& T_from, const SE3<Camera, Object>& T_to) {
  const Eigen::AngleAxisd turn(T_to.rotation() * T_from.rotation().conjugate());
  ObjectMotion motion;
  motion << turn.angle() * turn.axis(), T_to.translation() - T_from.translation();
  return motion;
}

// Scales by which residuals are divided.
struct ViewAlignment::Scales {
  double color = kInitialColorScale, outline = 1;
};

// A rendered point, projected into the view after the current motion.
struct ViewAlignment::Projection {
  cv::Point before;                  // pixel before the motion, in the crop
  Eigen::Vector2d at;                // pixel after the motion, in the crop
  Eigen::Matrix<double, 2, 6> flow;  // derivative of `at` with respect to the motion
};

// Normal equations at one motion.
struct ViewAlignment::Equations {
  struct Channel {
    ObjectMotion gradient = ObjectMotion::Zero();
    double residual = 0, weight = 0;
  };
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  ObjectMotion b = ObjectMotion::Zero();
  double cost = 0;
  std::array<Channel, 3> channels;
  std::vector<double> color_errors;
  double outline_square = 0;
  size_t outline_count = 0;

  void Add(const ObjectMotion& gradient, double residual, double weight) {
    A += weight * gradient * gradient.transpose();
    b += weight * residual * gradient;
  }

  // Eliminates a constant offset per channel, which models changes of exposure and light between views.
  void EliminateOffsets() {
    for (const Channel& channel : channels) {
      if (channel.weight <= 0) continue;
      A -= channel.gradient * channel.gradient.transpose() / channel.weight;
      b -= channel.gradient * channel.residual / channel.weight;
      cost -= channel.residual * channel.residual / channel.weight;
    }
  }

  // The spread of the residuals. It is large, so that they count little, while the field is still blurred.
  Scales ResidualScales() {
    const double outline = std::sqrt(outline_square / static_cast<double>(outline_count));
    return {std::max(kMinColorScale, 1.48 * Median(color_errors)), std::max(kMinOutlineScale, outline)};
  }
};

ViewAlignment::ViewAlignment(const ObjectView& view)
    : camera_(view.camera), roi_px_(view.roi_px), bgr_(view.color_bgr) {
  const cv::Size surroundings(2 * kReach_px + 1, 2 * kReach_px + 1);
  cv::GaussianBlur(bgr_, smooth_bgr_, {7, 7}, kSmoothing_px);
  object_ = view.ray_kind == static_cast<int>(RayKind::kObject);
  cv::blur(object_, ramp_, surroundings, {-1, -1}, cv::BORDER_REPLICATE);
  const cv::Mat occluder = view.ray_kind == static_cast<int>(RayKind::kOccluder);
  cv::dilate(occluder, near_occluder_, cv::getStructuringElement(cv::MORPH_RECT, surroundings));
}

std::vector<cv::Point> ViewAlignment::Pixels(size_t count, uint64_t salt) const {
  std::vector<cv::Point> inside, outline;
  for (int y = 0; y < roi_px_.height; ++y) {
    const uint8_t* ramp = ramp_.ptr<uint8_t>(y);
    const uint8_t* object = object_.ptr<uint8_t>(y);
    const uint8_t* near_occluder = near_occluder_.ptr<uint8_t>(y);
    for (int x = 0; x < roi_px_.width; ++x) {
      if (object[x] != 0) inside.emplace_back(x + roi_px_.x, y + roi_px_.y);
      if (ramp[x] > 0 && ramp[x] < 255 && near_occluder[x] == 0) outline.emplace_back(x + roi_px_.x, y + roi_px_.y);
    }
  }
  std::vector<cv::Point> chosen;
  AppendEvenlySpaced(inside, count, RandomUniform(salt, 7, 0), chosen);
  AppendEvenlySpaced(outline, count, RandomUniform(salt, 7, 1), chosen);
  return chosen;
}

// The change of the mask along the motion must equal the difference between rendering and mask at the start. Where both
// agree, the residual at zero motion is 0 for any width of the ramp, so a correct pose does not move.
void ViewAlignment::AddOutline(const RenderedPixel& pixel, const Projection& projection, const Scales& scales,
                               Equations& equations) const {
  const cv::Point now_px(cvRound(projection.at.x()), cvRound(projection.at.y()));
  if (near_occluder_.at<uint8_t>(projection.before) != 0 || near_occluder_.at<uint8_t>(now_px) != 0) return;
  const double change =
      Interpolate<1>(ramp_, projection.at.x(), projection.at.y())[0] - ramp_.at<uint8_t>(projection.before) / 255.0;
  const double residual = change + object_.at<uint8_t>(projection.before) / 255.0 - pixel.opacity;
  const double weight = 1 / (scales.outline * scales.outline);
  equations.Add((Gradient<1>(ramp_, projection.at) * projection.flow).transpose(), residual, weight);
  equations.cost += weight * residual * residual;
  equations.outline_square += residual * residual;
  ++equations.outline_count;
}

void ViewAlignment::AddColor(const RenderedPixel& pixel, const Projection& projection, const Scales& scales,
                             Equations& equations) const {
  if (pixel.opacity < kMinOpacity || object_.at<uint8_t>(projection.before) == 0) return;
  const Eigen::Array3d now = Interpolate<3>(smooth_bgr_, projection.at.x(), projection.at.y());
  const Eigen::Matrix<double, 3, 6> gradient = Gradient<3>(smooth_bgr_, projection.at) * projection.flow;
  const double limit = 1.345 * scales.color;  // Huber's
  for (int c = 0; c < 3; ++c) {
    const double before = smooth_bgr_.at<cv::Vec3b>(projection.before)[c] / 255.0;
    const double observed = bgr_.at<cv::Vec3b>(projection.before)[c] / 255.0;
    const double residual = now[c] - before + observed - pixel.bgr[static_cast<size_t>(c)];
    const double size = std::abs(residual), square = scales.color * scales.color;
    const double weight = (size <= limit ? 1 : limit / size) / square;
    const ObjectMotion row = gradient.row(c).transpose();
    equations.Add(row, residual, weight);
    equations.cost += (size <= limit ? size * size : 2 * limit * size - limit * limit) / square;
    Equations::Channel& channel = equations.channels[static_cast<size_t>(c)];
    channel.gradient += weight * row;
    channel.residual += weight * residual;
    channel.weight += weight;
    equations.color_errors.push_back(size);
  }
}

ViewAlignment::Equations ViewAlignment::Linearize(std::span<const RenderedPixel> rendered,
                                                  const Eigen::Vector3d& center, const ObjectMotion& motion,
                                                  const Scales& scales) const {
  Equations equations;
  const Eigen::Quaterniond turn = Turn(motion.head<3>());
  const Eigen::Vector2d corner(roi_px_.x, roi_px_.y);
  for (const RenderedPixel& pixel : rendered) {
    const Eigen::Vector3d arm = turn * (pixel.p_camera_mu - center);
    const Eigen::Vector3d p = center + arm + motion.tail<3>();
    const Eigen::Vector2d at = camera_.Project(p) - corner;
    const bool inside = at.x() >= kCropBorder_px && at.x() < roi_px_.width - kCropBorder_px &&
                        at.y() >= kCropBorder_px && at.y() < roi_px_.height - kCropBorder_px;
    if (p.z() <= 0 || !inside) continue;
    Eigen::Matrix<double, 3, 6> moved;
    moved << -Skew(arm), Eigen::Matrix3d::Identity();
    Eigen::Matrix<double, 2, 3> projected;
    projected << camera_.fx_px, 0, -camera_.fx_px * p.x() / p.z(), 0, camera_.fy_px, -camera_.fy_px * p.y() / p.z();
    const Projection projection{{pixel.u_px - roi_px_.x, pixel.v_px - roi_px_.y}, at, projected / p.z() * moved};
    AddOutline(pixel, projection, scales, equations);
    AddColor(pixel, projection, scales, equations);
  }
  equations.EliminateOffsets();
  return equations;
}

ObjectMotion ViewAlignment::Align(std::span<const RenderedPixel> rendered, const SE3<Camera, Object>& T_camera_object,
                                  const ObjectMotion& applied, double prior_px) const {
  const Eigen::Vector3d center = T_camera_object.translation();
  ObjectMotion best = ObjectMotion::Zero();
  Equations equations = Linearize(rendered, center, best, {});
  if (equations.color_errors.size() < 3 * kMinOpaquePixels || equations.outline_count == 0) return best;
  const Scales scales = equations.ResidualScales();
  // These deviations move the object by `prior_px` in the image, by a rotation or by a shift of the camera. They hardly
  // rotate the object.
  ObjectMotion per_deviation = ObjectMotion::Constant(camera_.fx_px / prior_px);
  per_deviation.tail<3>() /= center.z();
  const ObjectMotion prior = per_deviation.cwiseAbs2();
  const auto cost = [&](const ObjectMotion& motion) {
    return kInformation * equations.cost + prior.dot((applied + motion).cwiseAbs2());
  };
  equations = Linearize(rendered, center, best, scales);
  double lowest_cost = cost(best);
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Matrix<double, 6, 6> A = kInformation * equations.A;
    A.diagonal() += prior;
    const ObjectMotion step = A.ldlt().solve(-(kInformation * equations.b + prior.cwiseProduct(applied + best)));
    if (!step.allFinite()) break;
    equations = Linearize(rendered, center, best + step, scales);
    const double now = cost(best + step);
    if (!(now < lowest_cost)) break;
    lowest_cost = now;
    best += step;
  }
  return best;
}

}  // namespace romap::nerf
