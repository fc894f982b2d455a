#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/messages.h"
#include "server/objects/detections.h"

namespace romap {

// A keyframe's label image, thinned: it serves all objects of the keyframe and is kept long after the frame is gone.
struct ThinnedLabels {
  cv::Mat labels;  // CV_16UC1, every stride_px-th pixel of every stride_px-th row
  int stride_px = 1;
};

// Thins so that at most about 320 columns stay: a box then is within a pixel or two of the full resolution's.
ThinnedLabels ThinLabels(const cv::Mat& labels);

enum class MaskHit { kUnknown /* outside the image or behind something else */, kInside, kOutside };

// The outline of one object in one keyframe.
struct Silhouette {
  KeyframeId keyframe;
  CameraModel camera;
  SE3<World, Camera> T_world_camera;
  Eigen::Matrix<double, 3, 4> P_image_world;  // projection to homogeneous thinned pixels
  ThinnedLabels thinned;
  uint16_t label = 0;
  cv::Rect box_px;
  bool cut_by_border = false;
  std::vector<Eigen::Vector3d> outline_rays_world;  // unit directions through pixels on the mask's rim
  bool trusted = true;                              // false: contradicts the other silhouettes

  // What lies under a point of the world.
  MaskHit Look(const Eigen::Vector3d& p_world) const {
    return LookHomogeneous(P_image_world.leftCols<3>() * p_world + P_image_world.col(3));
  }
  // The same for an already projected point.
  MaskHit LookHomogeneous(const Eigen::Vector3d& q) const {
    if (!(q.z() > 1e-9)) return MaskHit::kUnknown;
    const double scale = 1 / q.z();
    const double u = q.x() * scale + 0.5;
    const double v = q.y() * scale + 0.5;
    if (!(u >= 0 && v >= 0 && u < thinned.labels.cols && v < thinned.labels.rows)) return MaskHit::kUnknown;
    const uint16_t seen = thinned.labels.ptr<uint16_t>(static_cast<int>(v))[static_cast<int>(u)];
    if (seen == label) return MaskHit::kInside;
    return seen == 0 ? MaskHit::kOutside : MaskHit::kUnknown;
  }
  Eigen::Vector3d CameraCenter() const { return T_world_camera.translation(); }
};

Silhouette MakeSilhouette(const KeyframeView& view, const ThinnedLabels& thinned, const Detection& detection);

// The point nearest to all rays through the middles of the silhouettes' boxes (least squares); nullopt when fewer than
// two uncut silhouettes differ by at least `min_parallax_rad`.
std::optional<Eigen::Vector3d> IntersectCenterRays(const std::vector<Silhouette>& silhouettes, double min_parallax_rad);

// Largest angle between the directions from `p_world` to the cameras of the silhouettes.
double ParallaxRad(const std::vector<Silhouette>& silhouettes, const Eigen::Vector3d& p_world);

}  // namespace romap
