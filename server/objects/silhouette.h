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

// A keyframe's masks, thinned: they serve all objects of the keyframe and are kept long after the frame is gone.
struct KeyframeMasks {
  cv::Mat index;  // CV_8UC1, every stride_px-th pixel: 0 nothing, i + 1 the keyframe's detection i, kOtherMask the rest
  cv::Mat framed;  // the same with a border of one pixel of kOtherMask; `index` is the inner part of it
  int stride_px = 1;
  std::vector<LandmarkKey> keys;  // landmark of each detection
};
inline constexpr uint8_t kOtherMask = 255;

// Thins so that at most about 320 columns stay: a box then is within a pixel or two of the full resolution's. `keys`
// are the landmarks of `detections`; beyond 254 of them are kOtherMask.
std::shared_ptr<const KeyframeMasks> ThinMasks(const cv::Mat& labels, const std::vector<Detection>& detections,
                                               const std::vector<LandmarkKey>& keys);

enum class MaskHit { kUnknown /* outside the image or behind something else */, kInside, kOutside };

// A cuboid as the map of its inside to the cube [-1, 1]^3.
struct UnitBox {
  Eigen::Matrix3d M;
  Eigen::Vector3d offset;

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_world) const { return M * p_world + offset; }
};

// The outline of one object in one keyframe.
struct Silhouette {
  KeyframeId keyframe;
  CameraModel camera;
  // All that follows is made with this pose. Corrections that change it against the object are collected apart until
  // they are worth the work.
  SE3<World, Camera> T_world_camera;
  SE3<World, Camera> corrected_T_world_camera;
  Eigen::Matrix<double, 3, 4> P_image_world;  // projection to homogeneous thinned pixels
  std::shared_ptr<const KeyframeMasks> masks;
  uint8_t index = 0;  // of the object in `masks`
  // By index in `masks` - 1: the cuboid of that thing, as far as known. It tells what the thing hides from what it
  // stands behind.
  std::vector<std::optional<UnitBox>> neighbours;
  cv::Rect box_px;
  bool cut_by_border = false;
  std::vector<Eigen::Vector3d> outline_rays_world;  // unit directions through pixels on the mask's rim
  MaskExtents extents;
  bool has_segments = false;  // someone looked for straight edges
  std::vector<LineSegment> segments;

  // What lies under a point of the world.
  MaskHit Look(const Eigen::Vector3d& p_world) const {
    return Judge(SeenAt(P_image_world.leftCols<3>() * p_world + P_image_world.col(3)), [&] { return p_world; });
  }
  // Value of masks->index under a projected point; -1 outside the image.
  int SeenAt(const Eigen::Vector3d& q) const {
    if (!(q.z() > 1e-9)) return -1;
    const double scale = 1 / q.z();
    const double u = q.x() * scale + 0.5;
    const double v = q.y() * scale + 0.5;
    const cv::Mat& image = masks->index;
    if (!(u >= 0 && v >= 0 && u < image.cols && v < image.rows)) return -1;
    return image.ptr<uint8_t>(static_cast<int>(v))[static_cast<int>(u)];
  }
  // `p_world()` gives the point that was projected; it is asked for only where another thing is seen.
  template <class PointFunction>
  MaskHit Judge(int seen, const PointFunction& p_world) const {
    if (seen == index) return MaskHit::kInside;
    if (seen == 0) return MaskHit::kOutside;
    return seen < 0 || MayHide(seen, p_world()) ? MaskHit::kUnknown : MaskHit::kOutside;
  }
  // Whether the thing with this index may stand between the camera and the point.
  bool MayHide(int seen, const Eigen::Vector3d& p_world) const;
  // Whether the object itself ends the mask in direction k (see ExtentDirection), and not the image or something that
  // may stand before the object, which is at about `center_world`.
  bool EndsFreely(int k, const Eigen::Vector3d& center_world) const;
  Eigen::Vector3d CameraCenter() const { return T_world_camera.translation(); }
};

// `detection_index` is the object's place among the detections that `masks` was made of.
// Its neighbours are unknown yet.
Silhouette MakeSilhouette(const KeyframeView& view, std::shared_ptr<const KeyframeMasks> masks,
                          const Detection& detection, size_t detection_index);

// The silhouette goes along with its object: it still sees the same in every place.
void Move(const Sim3<World, World>& S_new_old, Silhouette* silhouette);

// Takes over the corrected pose.
void ApplyCorrectedPose(Silhouette* silhouette);

// Tells a silhouette where the other things of its picture stand, as far as their cuboids are known.
void UpdateNeighbours(const std::map<LandmarkKey, Cuboid>& cuboids, Silhouette* silhouette);

// The point nearest to all rays through the middles of the silhouettes' boxes (least squares); nullopt when fewer than
// two uncut silhouettes differ by at least `min_parallax_rad`.
std::optional<Eigen::Vector3d> IntersectCenterRays(const std::vector<Silhouette>& silhouettes, double min_parallax_rad);

// Largest angle between the directions from `p_world` to the cameras of the silhouettes.
double ParallaxRad(const std::vector<Silhouette>& silhouettes, const Eigen::Vector3d& p_world);

}  // namespace romap::objects
