#include "server/nerf/depth_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace romap::nerf {
namespace {

constexpr int kProbesPerView = 60;
constexpr size_t kMostViews = 12;  // spread over all
constexpr int kBorder_px = 3;      // masks and poses are not sharper than this
constexpr std::array<double, 10> kOtherScales = {0.5, 0.7, 0.83, 0.91, 0.95, 1.05, 1.1, 1.2, 1.4, 2.0};
constexpr double kDepthNoise = 0.02;  // of the depth
constexpr double kMostMisplaced = 0.4;
constexpr double kNoise = 0.02;   // of the share, that says nothing
constexpr double kClearly = 0.5;  // another scale fits when it leaves less than this of the contradictions

struct Witness {
  const ObjectView* view;
  SE3<Camera, World> T_camera_world;
  cv::Mat background;  // without a border around what is not
  cv::Mat nearest_mu;  // least depth within the border, 0 where one is unknown
};

Witness MakeWitness(const ObjectView& view) {
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * kBorder_px + 1, 2 * kBorder_px + 1});
  Witness witness{&view, view.T_world_camera.Inverse(), {}, {}};
  cv::erode(view.ray_kind == static_cast<int>(RayKind::kBackground), witness.background, square);
  cv::Mat depth_mu = cv::Mat::zeros(view.depth_mu.size(), CV_32FC1);
  view.depth_mu.copyTo(depth_mu, view.depth_mu > 0);  // no number is not
  cv::erode(depth_mu, witness.nearest_mu, square);
  return witness;
}

std::vector<Witness> ChooseWitnesses(std::span<const ObjectView> views) {
  std::vector<const ObjectView*> with_depth;
  for (const ObjectView& view : views) {
    if (!view.depth_mu.empty()) with_depth.push_back(&view);
  }
  std::vector<Witness> witnesses;
  const size_t count = std::min(kMostViews, with_depth.size());
  for (size_t i = 0; i < count; ++i) witnesses.push_back(MakeWitness(*with_depth[i * with_depth.size() / count]));
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

enum class Verdict { kUnseen, kFits, kContradicts };

// The crop holds all of the object: what lies outside is not of it. Before what the witness measured there is nothing.
Verdict Ask(const Witness& witness, const Eigen::Vector3d& p_world, double scale) {
  const ObjectView& view = *witness.view;
  const Eigen::Vector3d p = witness.T_camera_world * p_world;
  if (p.z() <= 0) return Verdict::kUnseen;
  const Eigen::Vector2d pixel = view.camera.Project(p);
  if (!(pixel.array() >= 0).all() || pixel.x() >= view.camera.width_px || pixel.y() >= view.camera.height_px) {
    return Verdict::kUnseen;
  }
  const cv::Point at(cvRound(pixel.x()) - view.roi_px.x, cvRound(pixel.y()) - view.roi_px.y);
  if (!cv::Rect({0, 0}, view.roi_px.size()).contains(at)) return Verdict::kContradicts;
  const double measured_mu = scale * witness.nearest_mu.at<float>(at);
  const bool in_free_space = p.z() < (1 - kDepthNoise) * measured_mu;
  return witness.background.at<uint8_t>(at) != 0 || in_free_space ? Verdict::kContradicts : Verdict::kFits;
}

// Contradicted by a witness, or so far off that no other one sees it.
bool IsMisplaced(const std::vector<Witness>& witnesses, size_t own, const Eigen::Vector3d& p_world, double scale) {
  bool fits = false;
  for (size_t i = 0; i < witnesses.size(); ++i) {
    if (i == own) continue;
    const Verdict verdict = Ask(witnesses[i], p_world, scale);
    if (verdict == Verdict::kContradicts) return true;
    fits |= verdict == Verdict::kFits;
  }
  return !fits;
}

using Probes = std::vector<std::vector<Eigen::Vector3d>>;  // of each witness

double MisplacedShare(const std::vector<Witness>& witnesses, const Probes& probes, double scale) {
  size_t all = 0, misplaced = 0;
  for (size_t i = 0; i < witnesses.size(); ++i) {
    all += probes[i].size();
    for (const Eigen::Vector3d& p_camera : probes[i]) {
      const Eigen::Vector3d p_world = witnesses[i].view->T_world_camera * (scale * p_camera);
      misplaced += IsMisplaced(witnesses, i, p_world, scale) ? 1 : 0;
    }
  }
  return all > 0 ? static_cast<double>(misplaced) / static_cast<double>(all) : 0;
}

Probes AllProbes(const std::vector<Witness>& witnesses) {
  Probes probes;
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
  const Probes probes = AllProbes(witnesses);
  const double misplaced = MisplacedShare(witnesses, probes, 1);
  if (misplaced <= kNoise) return true;
  if (misplaced > kMostMisplaced) return false;
  return std::ranges::none_of(kOtherScales, [&](double scale) {
    return MisplacedShare(witnesses, probes, scale) < kClearly * misplaced - kNoise;
  });
}

}  // namespace romap::nerf
