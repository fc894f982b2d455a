#include "server/nerf/visual_hull.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "server/nerf/math/types.h"

namespace romap::nerf {
namespace {

constexpr int kCells = nerf::kOccupancyResolution;
constexpr double kDepthNoise = 0.01;  // of the depth: nearer to what was measured than this is not called empty
constexpr int kMostReach_px = 30;     // a camera so near tells too little of a cell
constexpr int kLargestBlock = 16;     // cells per side of the blocks that are tested as a whole first

size_t CellIndexOf(int x, int y, int z) { return (static_cast<size_t>(z) * kCells + y) * kCells + x; }

enum class Verdict { kUnknown, kEmpty, kFull, kMixed };

}  // namespace

// What a view's mask holds under a footprint.
struct VisualHull::Look {
  Verdict matter = Verdict::kUnknown;  // pixels that are not background
  Verdict object = Verdict::kUnknown;  // pixels that show the object itself
  // Whether all that lies under the footprint is alike.
  bool IsPlain() const {
    return matter == Verdict::kEmpty ||
           (matter == Verdict::kFull && (object == Verdict::kEmpty || object == Verdict::kFull));
  }
};

// One view's mask, ready to be asked about balls of the Object frame.
struct VisualHull::Footprints {
  SE3<Camera, Object> T_camera_object;
  CameraModel camera;
  cv::Rect roi_px;
  cv::Mat matter_sum;  // integral image of "not background"
  cv::Mat object_sum;  // the same of "object"
  cv::Mat nearest_mu;  // least depth under a cell's footprint, 0 where one is unknown; empty without depth

  Footprints(const ObjectView& view, const TrainingBox& box, bool use_depth, double cell_radius_mu)
      : T_camera_object(view.T_world_camera.Inverse() * box.T_world_object), camera(view.camera), roi_px(view.roi_px) {
    cv::integral((view.ray_kind != static_cast<int>(RayKind::kBackground)) / 255, matter_sum, CV_32S);
    cv::integral((view.ray_kind == static_cast<int>(RayKind::kObject)) / 255, object_sum, CV_32S);
    if (!use_depth || view.depth_mu.empty()) return;
    const double least_z_mu = T_camera_object.translation().z() - box.half_extents.norm();
    if (least_z_mu <= 0) return;  // some cells' footprints have no bound
    const int reach_px = 1 + static_cast<int>(cell_radius_mu * std::max(camera.fx_px, camera.fy_px) / least_z_mu);
    if (reach_px > kMostReach_px) return;
    cv::Mat known;
    cv::compare(view.depth_mu, 0, known, cv::CMP_GT);  // false for no number too
    cv::Mat depth_mu = cv::Mat::zeros(view.depth_mu.size(), CV_32FC1);
    view.depth_mu.copyTo(depth_mu, known);
    const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * reach_px + 1, 2 * reach_px + 1});
    cv::erode(depth_mu, nearest_mu, square);
  }

  bool KnowsDepth() const { return !nearest_mu.empty(); }

  // Whether all that was measured under a ball lies behind it.
  bool IsBeforeAll(const Eigen::Vector3d& center_object, double radius_mu) const {
    const Eigen::Vector3d p = T_camera_object * center_object;
    const Eigen::Vector2d pixel = camera.Project(p);
    const int x = static_cast<int>(std::lround(pixel.x())) - roi_px.x;
    const int y = static_cast<int>(std::lround(pixel.y())) - roi_px.y;
    if (x < 0 || y < 0 || x >= roi_px.width || y >= roi_px.height) return false;
    const double nearest = nearest_mu.at<float>(y, x);
    return nearest * (1 - kDepthNoise) > p.z() + radius_mu;
  }

  // The mask under a ball's footprint, taken as a square of its radius.
  Look Ask(const Eigen::Vector3d& center_object, double radius_mu) const {
    const Eigen::Vector3d p = T_camera_object * center_object;
    if (p.z() <= radius_mu) return {};
    const Eigen::Vector2d pixel = camera.Project(p);
    const double radius_px = radius_mu * std::max(camera.fx_px, camera.fy_px) / p.z();
    const int x0 = static_cast<int>(std::floor(pixel.x() - radius_px + 0.5)) - roi_px.x;
    const int y0 = static_cast<int>(std::floor(pixel.y() - radius_px + 0.5)) - roi_px.y;
    const int x1 = static_cast<int>(std::floor(pixel.x() + radius_px + 0.5)) - roi_px.x + 1;
    const int y1 = static_cast<int>(std::floor(pixel.y() + radius_px + 0.5)) - roi_px.y + 1;
    if (x0 < 0 || y0 < 0 || x1 > roi_px.width || y1 > roi_px.height) return {};
    const auto judge = [&](const cv::Mat& sum) {
      const int count = sum.at<int>(y1, x1) - sum.at<int>(y0, x1) - sum.at<int>(y1, x0) + sum.at<int>(y0, x0);
      if (count == 0) return Verdict::kEmpty;
      return count == (x1 - x0) * (y1 - y0) ? Verdict::kFull : Verdict::kMixed;
    };
    return {judge(matter_sum), judge(object_sum)};
  }
};

VisualHull::VisualHull(const NerfConfig& config)
    : carve_(config.carve_hull),
      margin_(config.hull_margin),
      min_votes_(config.hull_min_votes),
      vote_share_(config.hull_vote_share),
      show_share_(config.hull_show_share) {}

void VisualHull::Reset(const TrainingBox& box, bool use_depth) {
  box_ = box;
  use_depth_ = use_depth;
  seen_.assign(CellIndexOf(0, 0, kCells), 0);
  against_.assign(seen_.size(), 0);
  shown_.assign(seen_.size(), 0);
  views_ = 0;
}

double VisualHull::CellRadius_mu() const { return box_.half_extents.norm() / kCells * margin_; }

void VisualHull::Vote(const ObjectView& view, int sign) {
  views_ += sign;
  const Footprints footprints(view, box_, use_depth_, CellRadius_mu());
  for (int z = 0; z < kCells; z += kLargestBlock) {
    for (int y = 0; y < kCells; y += kLargestBlock) {
      for (int x = 0; x < kCells; x += kLargestBlock) VoteBlock(footprints, {x, y, z}, kLargestBlock, sign);
    }
  }
}

// Cells from `first` on, `side` along each axis. They are asked as a whole, and in halves where they are not alike.
void VisualHull::VoteBlock(const Footprints& footprints, const Eigen::Vector3i& first, int side, int sign) {
  const Eigen::Vector3d cell = 2.0 * box_.half_extents / kCells;
  const Eigen::Vector3d middle =
      (first.cast<double>().array() + 0.5 * side).matrix().cwiseProduct(cell) - box_.half_extents;
  const double radius_mu = side == 1 ? CellRadius_mu() : 0.5 * side * cell.norm();
  const Look look = footprints.Ask(middle, radius_mu);
  const bool depth_may_tell = footprints.KnowsDepth() && look.matter != Verdict::kEmpty;
  if (side > 1 && (!look.IsPlain() || depth_may_tell)) {
    const int half = side / 2;
    for (int octant = 0; octant < 8; ++octant) {
      const Eigen::Vector3i corner(octant & 1, octant >> 1 & 1, octant >> 2);
      VoteBlock(footprints, first + half * corner, half, sign);
    }
    return;
  }
  if (look.matter == Verdict::kUnknown) return;
  const bool empty = look.matter == Verdict::kEmpty || (depth_may_tell && footprints.IsBeforeAll(middle, radius_mu));
  const bool shown = !empty && look.object != Verdict::kEmpty;
  for (int z = first.z(); z < first.z() + side; ++z) {
    for (int y = first.y(); y < first.y() + side; ++y) {
      for (size_t i = CellIndexOf(first.x(), y, z), end = i + static_cast<size_t>(side); i < end; ++i) {
        seen_[i] = static_cast<uint8_t>(seen_[i] + sign);
        if (empty) against_[i] = static_cast<uint8_t>(against_[i] + sign);
        if (shown) shown_[i] = static_cast<uint8_t>(shown_[i] + sign);
      }
    }
  }
}

std::vector<uint8_t> VisualHull::Carve() const {
  if (!carve_) return std::vector<uint8_t>(seen_.size(), 1);
  const bool asks_evidence = show_share_ > 0 && views_ > 0;
  std::vector<uint8_t> cells(seen_.size());
  for (size_t i = 0; i < cells.size(); ++i) {
    const double needed = std::max<double>(min_votes_, vote_share_ * seen_[i]);
    cells[i] = against_[i] < needed && (shown_[i] > 0 || !asks_evidence) && shown_[i] >= show_share_ * seen_[i] ? 1 : 0;
  }
  return cells;
}

}  // namespace romap::nerf
