#include "server/nerf/visual_hull.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "server/hull/grid_projection.h"
#include "server/nerf/mask_border.h"
#include "server/nerf/math/types.h"

namespace romap::nerf {
namespace {

using hull::CellEvidence;

constexpr double kDepthNoise = 0.01;  // share of the depth by which a measurement may be too far
constexpr int kMaxReach_px = 30;      // larger footprints: the camera is too close for depth to carve
constexpr int kMaxBlock = 16;         // cells per side of the blocks that are tested as a whole first

}  // namespace

enum class Coverage { kUnknown, kNone, kFull, kPartial };

// How a view's mask covers a footprint.
struct VisualHull::Verdict {
  Coverage foreground = Coverage::kUnknown;  // pixels that are not certainly background
  Coverage object = Coverage::kUnknown;      // pixels that show the object
  bool in_image = false;                     // the whole footprint, whether inside the crop or not

  // Whether every smaller footprint inside this one has the same evidence.
  bool IsUniform() const {
    return foreground == Coverage::kNone ||
           (foreground == Coverage::kFull && (object == Coverage::kNone || object == Coverage::kFull));
  }
};

// One view's mask and depth, prepared for queries by balls of the Object frame.
class VisualHull::Footprints {
 public:
  Footprints(const ObjectView& view, const TrainingBox& box, const InputQuality& quality, double cell_radius_mu)
      : image_px_(view.camera.width_px, view.camera.height_px),
        roi_px_(view.roi_px),
        focal_px_(std::max(view.camera.fx_px, view.camera.fy_px)) {
    const SE3<Camera, Object> T_camera_object = view.T_world_camera.Inverse() * box.T_world_object;
    projection_ =
        hull::GridProjection::Of(view.camera, T_camera_object.RotationMatrix(), T_camera_object.translation());
    const cv::Mat object = view.ray_kind == static_cast<int>(RayKind::kObject);
    cv::Mat foreground;
    cv::bitwise_or(view.ray_kind == static_cast<int>(RayKind::kOccluder), PossibleObject(view, quality.mask_border_px),
                   foreground);
    cv::integral(foreground / 255, foreground_sum_, CV_32S);
    cv::integral(object / 255, object_sum_, CV_32S);
    if (!quality.depth_is_consistent || view.depth_mu.empty()) return;
    const double min_z_mu = T_camera_object.translation().z() - box.half_extents.norm();
    if (min_z_mu <= 0) return;  // the footprints of some cells are unbounded
    const int reach_px = 1 + static_cast<int>(cell_radius_mu * focal_px_ / min_z_mu);
    if (reach_px > kMaxReach_px) return;
    cv::Mat known;
    cv::compare(view.depth_mu, 0, known, cv::CMP_GT);  // false for NaN too
    cv::Mat depth_mu = cv::Mat::zeros(view.depth_mu.size(), CV_32FC1);
    view.depth_mu.copyTo(depth_mu, known);
    const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * reach_px + 1, 2 * reach_px + 1});
    cv::erode(depth_mu, nearest_mu_, square);
  }

  bool HasDepth() const { return !nearest_mu_.empty(); }

  // Whether all depth under a ball was measured behind it.
  bool IsInFrontOfDepth(const Eigen::Vector3d& center_object, double radius_mu) const {
    const Eigen::Vector3d q = projection_ * center_object;
    const int x = static_cast<int>(std::lround(q.x() / q.z())) - roi_px_.x;
    const int y = static_cast<int>(std::lround(q.y() / q.z())) - roi_px_.y;
    if (x < 0 || y < 0 || x >= roi_px_.width || y >= roi_px_.height) return false;
    const double nearest_mu = nearest_mu_.at<float>(y, x);
    return nearest_mu * (1 - kDepthNoise) > q.z() + radius_mu;
  }

  // The mask under a ball, whose footprint is taken as a square.
  Verdict Under(const Eigen::Vector3d& center_object, double radius_mu) const {
    const Eigen::Vector3d q = projection_ * center_object;
    if (q.z() <= radius_mu) return {};
    const double u_px = q.x() / q.z(), v_px = q.y() / q.z();
    const double radius_px = radius_mu * focal_px_ / q.z();
    const int left = static_cast<int>(std::floor(u_px - radius_px + 0.5));
    const int top = static_cast<int>(std::floor(v_px - radius_px + 0.5));
    const int right = static_cast<int>(std::floor(u_px + radius_px + 0.5)) + 1;
    const int bottom = static_cast<int>(std::floor(v_px + radius_px + 0.5)) + 1;
    const bool in_image = left >= 0 && top >= 0 && right <= image_px_.width && bottom <= image_px_.height;
    const int x0 = left - roi_px_.x, y0 = top - roi_px_.y, x1 = right - roi_px_.x, y1 = bottom - roi_px_.y;
    if (x0 < 0 || y0 < 0 || x1 > roi_px_.width || y1 > roi_px_.height) return {.in_image = in_image};
    const auto coverage = [&](const cv::Mat& sum) {
      const int count = sum.at<int>(y1, x1) - sum.at<int>(y0, x1) - sum.at<int>(y1, x0) + sum.at<int>(y0, x0);
      if (count == 0) return Coverage::kNone;
      return count == (x1 - x0) * (y1 - y0) ? Coverage::kFull : Coverage::kPartial;
    };
    return {coverage(foreground_sum_), coverage(object_sum_), in_image};
  }

 private:
  hull::GridProjection projection_;
  cv::Size image_px_;
  cv::Rect roi_px_;
  double focal_px_;
  cv::Mat foreground_sum_;  // integral image of "not certainly background"
  cv::Mat object_sum_;      // integral image of "object"
  cv::Mat nearest_mu_;  // least depth under the footprint of a cell, 0 if part of it is unknown; empty without depth
};

CellEvidence VisualHull::EvidenceOf(const Verdict& verdict, bool in_front_of_depth) {
  if (verdict.foreground == Coverage::kUnknown) return verdict.in_image ? CellEvidence::kCropped : CellEvidence::kNone;
  if (verdict.foreground == Coverage::kNone || in_front_of_depth) return CellEvidence::kBackground;
  return verdict.object == Coverage::kNone ? CellEvidence::kOccluded : CellEvidence::kObject;
}

VisualHull::VisualHull(const NerfConfig& config)
    : carve_(config.carve_hull),
      margin_(config.hull_margin),
      rule_{.min_background = config.hull_min_votes,
            .background_share = config.hull_vote_share,
            .min_object = config.hull_show_share > 0 ? 1 : 0,
            .object_share = config.hull_show_share} {}

void VisualHull::Reset(const TrainingBox& box, const InputQuality& quality) {
  box_ = box;
  quality_ = quality;
  evidence_.Reset({box.half_extents, kOccupancyResolution});
  views_ = 0;
}

double VisualHull::CellRadius_mu() const { return box_.half_extents.norm() / kOccupancyResolution * margin_; }

void VisualHull::Count(const ObjectView& view, int sign) {
  views_ += sign;
  const Footprints footprints(view, box_, quality_, CellRadius_mu());
  for (int z = 0; z < kOccupancyResolution; z += kMaxBlock) {
    for (int y = 0; y < kOccupancyResolution; y += kMaxBlock) {
      for (int x = 0; x < kOccupancyResolution; x += kMaxBlock) {
        CountBlock(footprints, {x, y, z}, kMaxBlock, sign);
      }
    }
  }
}

// Counts the cells from `first` on, `side` along each axis: as a whole if their evidence is the same, otherwise by
// octants.
void VisualHull::CountBlock(const Footprints& footprints, const Eigen::Vector3i& first, int side, int sign) {
  const hull::VoxelGrid& grid = evidence_.grid();
  const Eigen::Vector3d center = grid.BlockCenter(first, side);
  const double radius_mu = side == 1 ? CellRadius_mu() : 0.5 * side * grid.CellSize().norm();
  const Verdict verdict = footprints.Under(center, radius_mu);
  const bool depth_may_carve =
      footprints.HasDepth() && verdict.foreground != Coverage::kNone && verdict.foreground != Coverage::kUnknown;
  if (side > 1 && (!verdict.IsUniform() || depth_may_carve)) {
    const int half = side / 2;
    for (int octant = 0; octant < 8; ++octant) {
      const Eigen::Vector3i corner(octant & 1, octant >> 1 & 1, octant >> 2);
      CountBlock(footprints, first + half * corner, half, sign);
    }
    return;
  }
  const bool in_front = depth_may_carve && footprints.IsInFrontOfDepth(center, radius_mu);
  const CellEvidence evidence = EvidenceOf(verdict, in_front);
  for (int z = first.z(); z < first.z() + side; ++z) {
    for (int y = first.y(); y < first.y() + side; ++y) {
      evidence_.Count(grid.Index(first.x(), y, z), static_cast<size_t>(side), evidence, sign);
    }
  }
}

std::vector<uint8_t> VisualHull::Carve() const {
  if (!carve_ || views_ == 0) return std::vector<uint8_t>(evidence_.grid().size(), 1);
  return evidence_.Carve(rule_);
}

}  // namespace romap::nerf
