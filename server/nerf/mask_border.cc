#include "server/nerf/mask_border.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "common/statistics.h"
#include "server/nerf/cpu/ray_renderer.h"

namespace romap::nerf {
namespace {

constexpr int kReach_px = 8;  // of the search for the silhouette, on either side of the border
constexpr size_t kProfilePixels = 2 * kReach_px + 1;
constexpr size_t kMaxViews = 24;          // evenly spaced over the trusted views
constexpr size_t kMaxPointsPerView = 16;  // evenly spaced over the border
constexpr int kMinPoints = 60;            // for a reliable spread
constexpr float kSilhouetteOpacity = 0.5f;
// With exact masks the spread is 0 to 0.8 px, because the silhouette of a field is not exact either.
constexpr double kPreciseSpread_px = 0.9;

struct BorderPoint {
  cv::Point at_px;           // in the crop: an object pixel beside a background pixel
  cv::Point2d outward = {};  // unit normal of the mask's border
};

std::vector<BorderPoint> BorderPoints(const ObjectView& view) {
  const cv::Mat object = view.ray_kind == static_cast<int>(RayKind::kObject);
  cv::Mat blurred, dx, dy;
  cv::GaussianBlur(object, blurred, {}, 2);
  cv::Sobel(blurred, dx, CV_32F, 1, 0);
  cv::Sobel(blurred, dy, CV_32F, 0, 1);
  const auto is_background = [&](int x, int y) {
    return view.ray_kind.at<uint8_t>(y, x) == static_cast<uint8_t>(RayKind::kBackground);
  };
  std::vector<BorderPoint> points;
  for (int y = 1; y + 1 < object.rows; ++y) {
    for (int x = 1; x + 1 < object.cols; ++x) {
      if (object.at<uint8_t>(y, x) == 0) continue;
      if (!is_background(x - 1, y) && !is_background(x + 1, y) && !is_background(x, y - 1) &&
          !is_background(x, y + 1)) {
        continue;
      }
      const cv::Point2d inward(dx.at<float>(y, x), dy.at<float>(y, x));
      const double length = std::hypot(inward.x, inward.y);
      if (length > 0) points.push_back({{x, y}, -inward / length});
    }
  }
  return points;
}

// The pixels of the crop along the normal, from the outermost inwards.
std::vector<cv::Point> Profile(const BorderPoint& point) {
  std::vector<cv::Point> pixels;
  for (int offset = kReach_px; offset >= -kReach_px; --offset) {
    pixels.emplace_back(cvRound(point.at_px.x + offset * point.outward.x),
                        cvRound(point.at_px.y + offset * point.outward.y));
  }
  return pixels;
}

// Appends kProfilePixels rays for each of at most kMaxPointsPerView border points.
void AddProfiles(const ObjectView& view, uint16_t index, const RaySet& rays, std::vector<Ray>& profiles) {
  const cv::Rect crop({0, 0}, view.roi_px.size());
  const std::vector<BorderPoint> points = BorderPoints(view);
  const size_t taken = std::min(points.size(), kMaxPointsPerView);
  for (size_t p = 0; p < taken; ++p) {
    const std::vector<cv::Point> pixels = Profile(points[p * points.size() / taken]);
    if (!crop.contains(pixels.front()) || !crop.contains(pixels.back())) continue;
    for (const cv::Point& at : pixels) {
      const auto u_px = static_cast<uint16_t>(at.x + view.roi_px.x), v_px = static_cast<uint16_t>(at.y + view.roi_px.y);
      const TrainingPixel pixel{.view = index, .u_px = u_px, .v_px = v_px, .rgb = {}, .z_mu = 0};
      profiles.push_back(rays.Through(pixel, /*is_object=*/true, 0.5f));
    }
  }
}

// The offset along the normal [px] at which the field's opacity, from the outside, first reaches that of a silhouette.
// nullopt if it does not, or does so at once.
std::optional<double> Silhouette_px(std::span<const RayResult> profile) {
  for (size_t i = 0; i < profile.size(); ++i) {
    if (profile[i].opacity < kSilhouetteOpacity) continue;
    if (i == 0) return std::nullopt;
    const double rise = profile[i].opacity - profile[i - 1].opacity;
    const double back = (profile[i].opacity - kSilhouetteOpacity) / rise;
    return kReach_px - static_cast<double>(i) + back;
  }
  return std::nullopt;
}

}  // namespace

cv::Mat PossibleObject(const ObjectView& view, int border_px) {
  cv::Mat object = view.ray_kind == static_cast<int>(RayKind::kObject);
  if (border_px == 0) return object;
  cv::Mat near_object;
  cv::dilate(object, near_object, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * border_px + 1, 2 * border_px + 1}));
  return near_object;
}

MaskNoise MeasureMaskNoise(std::span<const ObjectView> views, std::span<const float> weights, const RaySet& rays,
                           const FieldModel& model, const NerfConfig& config, const RenderSpace& space) {
  std::vector<size_t> trusted;
  for (size_t i = 0; i < views.size(); ++i) {
    if (weights[i] > 0) trusted.push_back(i);
  }
  std::vector<Ray> profiles;
  const size_t count = std::min(trusted.size(), kMaxViews);
  for (size_t k = 0; k < count; ++k) {
    const size_t view = trusted[k * trusted.size() / count];
    AddProfiles(views[view], static_cast<uint16_t>(view), rays, profiles);
  }
  const std::vector<RayResult> results = RenderRays(model, config, space, profiles);
  std::vector<double> offsets_px;
  for (size_t first = 0; first < results.size(); first += kProfilePixels) {
    const auto offset_px = Silhouette_px(std::span(results).subspan(first, kProfilePixels));
    if (offset_px) offsets_px.push_back(*offset_px);
  }
  if (offsets_px.empty()) return {};
  constexpr double kSigmasPerQuartileRange = 1.349;  // of a normal distribution
  return {static_cast<int>(offsets_px.size()),
          (Quantile(offsets_px, 0.75) - Quantile(offsets_px, 0.25)) / kSigmasPerQuartileRange};
}

int UncertainBorder_px(const MaskNoise& noise, double spreads) {
  if (noise.points < kMinPoints || noise.spread_px < kPreciseSpread_px) return 0;
  return cvRound(spreads * noise.spread_px);
}

}  // namespace romap::nerf
