#include "server/nerf/depth_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace romap::nerf {
namespace {

constexpr int kPointsPerView = 60;
constexpr size_t kMaxViews = 12;   // evenly spaced among all
constexpr int kMaskBorder_px = 3;  // accuracy of masks and poses
constexpr std::array<double, 10> kOtherScales = {0.5, 0.7, 0.83, 0.91, 0.95, 1.05, 1.1, 1.2, 1.4, 2.0};
constexpr double kSensorDepthNoise = 0.02;  // of the depth
constexpr double kMaxMisplacedShare = 0.4;
constexpr double kShareNoise = 0.02;     // smaller misplaced shares are not significant
constexpr double kClearReduction = 0.5;  // another scale fits if it leaves less than this share of the contradictions

struct DepthView {
  const ObjectView* view;
  SE3<Camera, World> T_camera_world;
  cv::Mat background;    // CV_8UC1, not 0 = background, eroded by the border
  cv::Mat min_depth_mu;  // CV_32FC1, smallest depth within the border, 0 if any is unknown
};

DepthView MakeDepthView(const ObjectView& view) {
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * kMaskBorder_px + 1, 2 * kMaskBorder_px + 1});
  DepthView result{&view, view.T_world_camera.Inverse(), {}, {}};
  cv::erode(view.ray_kind == static_cast<int>(RayKind::kBackground), result.background, square);
  cv::Mat depth_mu = cv::Mat::zeros(view.depth_mu.size(), CV_32FC1);
  view.depth_mu.copyTo(depth_mu, view.depth_mu > 0);  // false for NaN
  cv::erode(depth_mu, result.min_depth_mu, square);
  return result;
}

std::vector<DepthView> ChooseViews(std::span<const ObjectView> views) {
  std::vector<const ObjectView*> with_depth;
  for (const ObjectView& view : views) {
    if (!view.depth_mu.empty()) with_depth.push_back(&view);
  }
  std::vector<DepthView> chosen;
  const size_t count = std::min(kMaxViews, with_depth.size());
  for (size_t i = 0; i < count; ++i) chosen.push_back(MakeDepthView(*with_depth[i * with_depth.size() / count]));
  return chosen;
}

// Points, in camera coordinates, of object pixels with depth, evenly spaced over the mask.
std::vector<Eigen::Vector3d> SamplePoints(const ObjectView& view) {
  std::vector<cv::Point> pixels;
  cv::findNonZero((view.ray_kind == static_cast<int>(RayKind::kObject)) & (view.depth_mu > 0), pixels);
  std::vector<Eigen::Vector3d> points;
  const size_t step = std::max<size_t>(1, pixels.size() / kPointsPerView);
  for (size_t i = step / 2; i < pixels.size(); i += step) {
    const double z_mu = view.depth_mu.at<float>(pixels[i]);
    if (!std::isfinite(z_mu)) continue;
    points.push_back(z_mu * view.camera.Unproject(pixels[i].x + view.roi_px.x, pixels[i].y + view.roi_px.y));
  }
  return points;
}

enum class Verdict { kNotVisible, kAgrees, kContradicts };

// Whether `other` agrees that the object has a point at `p_world`. Its crop contains the whole object, so points
// outside the crop are not on the object. The space in front of its measured depth is empty.
Verdict Compare(const DepthView& other, const Eigen::Vector3d& p_world, double scale) {
  const ObjectView& view = *other.view;
  const Eigen::Vector3d p = other.T_camera_world * p_world;
  if (p.z() <= 0) return Verdict::kNotVisible;
  const Eigen::Vector2d pixel = view.camera.Project(p);
  if (!(pixel.array() >= 0).all() || pixel.x() >= view.camera.width_px || pixel.y() >= view.camera.height_px) {
    return Verdict::kNotVisible;
  }
  const cv::Point at(cvRound(pixel.x()) - view.roi_px.x, cvRound(pixel.y()) - view.roi_px.y);
  if (!cv::Rect({0, 0}, view.roi_px.size()).contains(at)) return Verdict::kContradicts;
  const double measured_mu = scale * other.min_depth_mu.at<float>(at);
  const bool in_free_space = p.z() < (1 - kSensorDepthNoise) * measured_mu;
  return other.background.at<uint8_t>(at) != 0 || in_free_space ? Verdict::kContradicts : Verdict::kAgrees;
}

// True if any view other than `own` contradicts the point, or if it is visible in none of them.
bool IsMisplaced(const std::vector<DepthView>& views, size_t own, const Eigen::Vector3d& p_world, double scale) {
  bool agrees = false;
  for (size_t i = 0; i < views.size(); ++i) {
    if (i == own) continue;
    const Verdict verdict = Compare(views[i], p_world, scale);
    if (verdict == Verdict::kContradicts) return true;
    agrees |= verdict == Verdict::kAgrees;
  }
  return !agrees;
}

using Points = std::vector<std::vector<Eigen::Vector3d>>;  // of each view

// The share of all points, with depth multiplied by `scale`, that are misplaced.
double MisplacedShare(const std::vector<DepthView>& views, const Points& points, double scale) {
  size_t all = 0, misplaced = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    all += points[i].size();
    for (const Eigen::Vector3d& p_camera : points[i]) {
      const Eigen::Vector3d p_world = views[i].view->T_world_camera * (scale * p_camera);
      misplaced += IsMisplaced(views, i, p_world, scale) ? 1 : 0;
    }
  }
  return all > 0 ? static_cast<double>(misplaced) / static_cast<double>(all) : 0;
}

}  // namespace

bool DepthIsConsistent(std::span<const ObjectView> views) {
  const std::vector<DepthView> chosen = ChooseViews(views);
  if (chosen.size() < 2) return true;
  Points points;
  for (const DepthView& view : chosen) points.push_back(SamplePoints(*view.view));
  const double misplaced = MisplacedShare(chosen, points, 1);
  if (misplaced <= kShareNoise) return true;
  if (misplaced > kMaxMisplacedShare) return false;
  return std::ranges::none_of(kOtherScales, [&](double scale) {
    return MisplacedShare(chosen, points, scale) < kClearReduction * misplaced - kShareNoise;
  });
}

}  // namespace romap::nerf
