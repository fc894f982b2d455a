#include "server/nerf/depth_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace romap {
namespace {

constexpr int kProbesPerView = 60;
constexpr size_t kMostViews = 12;  // spread over all
constexpr int kBorder_px = 3;      // masks and poses are not sharper than this
constexpr std::array<double, 10> kOtherScales = {0.5, 0.7, 0.83, 0.91, 0.95, 1.05, 1.1, 1.2, 1.4, 2.0};
constexpr double kMostMisplaced = 0.4;
constexpr double kNoise = 0.02;   // of the share, that says nothing
constexpr double kClearly = 0.5;  // another scale fits when it leaves less than this of the contradictions

struct Witness {
  const ObjectView* view;
  SE3<Camera, World> T_camera_world;
  cv::Mat background;  // without a border around what is not
};

std::vector<Witness> ChooseWitnesses(std::span<const ObjectView> views) {
  std::vector<const ObjectView*> with_depth;
  for (const ObjectView& view : views) {
    if (!view.depth_mu.empty()) with_depth.push_back(&view);
  }
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * kBorder_px + 1, 2 * kBorder_px + 1});
  std::vector<Witness> witnesses;
  const size_t count = std::min(kMostViews, with_depth.size());
  for (size_t i = 0; i < count; ++i) {
    const ObjectView& view = *with_depth[i * with_depth.size() / count];
    Witness witness{&view, view.T_world_camera.Inverse(), {}};
    cv::erode(view.ray_kind == static_cast<int>(RayKind::kBackground), witness.background, square);
    witnesses.push_back(std::move(witness));
  }
  return witnesses;
}

// Places in camera coordinates of some object pixels with depth, spread evenly over the mask.
std::vector<Eigen::Vector3d> ProbesOf(const ObjectView& view) {
  std::vector<cv::Point> pixels;
  cv::findNonZero((view.ray_kind == static_cast<int>(RayKind::kObject)) & (view.depth_mu > 0), pixels);
  std::vector<Eigen::Vector3d> probes;
  const size_t step = std::max<size_t>(1, pixels.size() / kProbesPerView);
  for (size_t i = step / 2; i < pixels.size(); i += step) {
    const double z_mu = view.depth_mu.at<float>(pixels[i]);
    if (!std::isfinite(z_mu)) continue;
    probes.push_back(z_mu * view.camera.Unproject(pixels[i].x + view.roi_px.x, pixels[i].y + view.roi_px.y));
  }
  return probes;
}

// The crop holds all of the object: what lies outside is not of it. Of what the image does not show nothing is known.
bool Contradicts(const Witness& witness, const Eigen::Vector3d& p_world) {
  const ObjectView& view = *witness.view;
  const Eigen::Vector3d p = witness.T_camera_world * p_world;
  if (p.z() <= 0) return false;
  const Eigen::Vector2d pixel = view.camera.Project(p);
  if (!(pixel.array() >= 0).all() || pixel.x() >= view.camera.width_px || pixel.y() >= view.camera.height_px) {
    return false;
  }
  const cv::Point at(cvRound(pixel.x()) - view.roi_px.x, cvRound(pixel.y()) - view.roi_px.y);
  if (!cv::Rect({0, 0}, view.roi_px.size()).contains(at)) return true;
  return witness.background.at<uint8_t>(at) != 0;
}

double MisplacedShare(const std::vector<Witness>& witnesses, const std::vector<std::vector<Eigen::Vector3d>>& probes,
                      double scale) {
  size_t all = 0, misplaced = 0;
  for (size_t i = 0; i < witnesses.size(); ++i) {
    all += probes[i].size();
    for (const Eigen::Vector3d& p_camera : probes[i]) {
      const Eigen::Vector3d p_world = witnesses[i].view->T_world_camera * (scale * p_camera);
      misplaced += std::ranges::any_of(witnesses, [&](const Witness& w) { return Contradicts(w, p_world); }) ? 1 : 0;
    }
  }
  return all > 0 ? static_cast<double>(misplaced) / static_cast<double>(all) : 0;
}

std::vector<std::vector<Eigen::Vector3d>> AllProbes(const std::vector<Witness>& witnesses) {
  std::vector<std::vector<Eigen::Vector3d>> probes;
  for (const Witness& witness : witnesses) probes.push_back(ProbesOf(*witness.view));
  return probes;
}

}  // namespace

double MisplacedShare(std::span<const ObjectView> views, double scale) {
  const std::vector<Witness> witnesses = ChooseWitnesses(views);
  return MisplacedShare(witnesses, AllProbes(witnesses), scale);
}

bool DepthsFit(std::span<const ObjectView> views) {
  const std::vector<Witness> witnesses = ChooseWitnesses(views);
  if (witnesses.size() < 2) return true;
  const auto probes = AllProbes(witnesses);
  const double misplaced = MisplacedShare(witnesses, probes, 1);
  if (misplaced <= kNoise) return true;
  if (misplaced > kMostMisplaced) return false;
  return std::ranges::none_of(kOtherScales, [&](double scale) {
    return MisplacedShare(witnesses, probes, scale) < kClearly * misplaced - kNoise;
  });
}

}  // namespace romap
