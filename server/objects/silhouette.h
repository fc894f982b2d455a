#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/cuboid.h"
#include "common/stage_messages.h"
#include "server/objects/detections.h"
#include "server/objects/lines/line_segments.h"
#include "server/objects/mask_extents.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// The masks of a keyframe, subsampled to save memory: shared by all its silhouettes and kept longer than the frame.
struct KeyframeMasks {
  // CV_8UC1, every stride_px-th pixel: 0 background, i + 1 detection i of the keyframe, kOtherMask other masks.
  cv::Mat index;
  cv::Mat padded;  // `index` with a border of one pixel of kOtherMask; shares its memory
  int stride_px = 1;
  std::vector<LandmarkKey> keys;  // landmark of each detection
};
inline constexpr uint8_t kOtherMask = 255;

// Subsamples to at most about 320 columns, which changes a mask's box by a pixel or two. `keys`: the landmarks of
// `detections`. Detections beyond the first 254 are kOtherMask.
std::shared_ptr<const KeyframeMasks> SubsampleMasks(const cv::Mat& labels, const std::vector<Detection>& detections,
                                                    const std::vector<LandmarkKey>& keys);

// A cuboid, represented by the affine map from the world frame that maps its inside to the cube [-1, 1]^3.
struct UnitBox {
  Eigen::Matrix3d M;
  Eigen::Vector3d offset;

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_world) const { return M * p_world + offset; }
};

// The outline of one object in one keyframe.
struct Silhouette {
  KeyframeId keyframe;
  CameraModel camera;
  // Projection and rays below are for this pose. Corrections relative to the object are collected in the second one
  // until they are large enough to recompute them, see ApplyCorrectedPose().
  SE3<World, Camera> T_world_camera;
  SE3<World, Camera> corrected_T_world_camera;
  Eigen::Matrix<double, 3, 4> P_image_world;  // projection to homogeneous pixels of `masks`
  std::shared_ptr<const KeyframeMasks> masks;
  uint8_t index = 0;  // of the object in `masks`
  // By index in `masks` - 1: the cuboid of that object, if known. It separates points that the object may occlude from
  // points in front of it.
  std::vector<std::optional<UnitBox>> neighbors;
  cv::Rect box_px;
  bool cut_by_border = false;
  std::vector<Eigen::Vector3d> outline_rays_world;  // unit directions through pixels on the mask's outline
  MaskExtents extents;
  bool has_segments = false;  // straight edges were detected; there may be none
  std::vector<LineSegment> segments;

  // Value of masks->index at a projected point; -1 outside the image.
  int IndexAt(const Eigen::Vector3d& q) const {
    if (!(q.z() > 1e-9)) return -1;
    const double scale = 1 / q.z();
    const double u = q.x() * scale + 0.5;
    const double v = q.y() * scale + 0.5;
    const cv::Mat& image = masks->index;
    if (!(u >= 0 && v >= 0 && u < image.cols && v < image.rows)) return -1;
    return image.ptr<uint8_t>(static_cast<int>(v))[static_cast<int>(u)];
  }
  // Whether the object with this index may be between the camera and the point.
  bool MayOcclude(int mask_index, const Eigen::Vector3d& p_world) const;
  // Whether the end of the mask in direction k (see ExtentDirection) is the end of the object: it is not cut off by the
  // image or by another object that may occlude this one. `center_world`: approximate center of the object.
  bool IsFreeExtent(int k, const Eigen::Vector3d& center_world) const;
  Eigen::Vector3d CameraCenter() const { return T_world_camera.translation(); }
};

// `detection_index`: of `detection` among those that `masks` was made of. The neighbors are not set.
Silhouette MakeSilhouette(const KeyframeView& view, std::shared_ptr<const KeyframeMasks> masks,
                          const Detection& detection, size_t detection_index);

// Moves the silhouette with the space around its object: every point that moves with this space projects to the same
// pixel as before.
void Move(const Sim3<World, World>& S_new_old, Silhouette* silhouette);

// Recomputes projection and rays for the corrected pose.
void ApplyCorrectedPose(Silhouette* silhouette);

// Updates the neighbors of the silhouette from the known cuboids.
void UpdateNeighbors(const std::map<LandmarkKey, Cuboid>& cuboids, Silhouette* silhouette);

// The point nearest to all rays through the middles of the silhouettes' boxes (least squares). Uses only silhouettes
// not cut off by the border; nullopt when these have less parallax than `min_parallax_rad`.
std::optional<Eigen::Vector3d> IntersectCenterRays(const std::vector<Silhouette>& silhouettes, double min_parallax_rad);

// Largest angle between the directions from `p_world` to the cameras of the silhouettes.
double ParallaxRad(const std::vector<Silhouette>& silhouettes, const Eigen::Vector3d& p_world);

}  // namespace romap::objects
