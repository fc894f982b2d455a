#pragma once

// A small synthetic world with known ground truth for the tests of every stage: boxes and ellipsoids on a table, seen
// by a camera on an orbit, with instance masks rendered by ray casting and sparse map points. Noise, outliers and
// detector errors are adjustable.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/cuboid.h"
#include "common/stage_messages.h"

namespace romap {

enum class SyntheticShape { kBox, kEllipsoid };

// An upright solid. `center` is in scene coordinates: table top at z = 0, z up, map units.
struct SyntheticObject {
  std::string class_name;
  SyntheticShape shape = SyntheticShape::kBox;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extents = Eigen::Vector3d::Constant(0.1);
  double yaw_rad = 0;
};

// Class name of SyntheticWorldOptions::false_detections.
inline constexpr const char* kFalseDetectionClass = "false detection";

struct SyntheticWorldOptions {
  std::vector<SyntheticObject> objects;  // empty: DefaultSyntheticObjects()
  int width_px = 320;
  int height_px = 240;
  double focal_px = 300;
  int frames = 60;
  int keyframe_every = 3;  // frames
  double orbit_radius_mu = 1.2;
  double elevation_deg = 35;
  double start_azimuth_deg = 0;
  double sweep_deg = 360;                        // azimuth covered by all frames together
  std::vector<std::pair<int, int>> away_frames;  // [first, last): the camera points away from the table
  Eigen::Vector3d up_world{0, 0, 1};             // direction of the z axis of the scene in the World frame
  int points_per_object = 60;                    // sparse map points on each surface
  int points_on_table = 250;                     // sparse map points on the table
  std::vector<int> textureless;                  // indices of objects without map points
  double pixel_noise_px = 0;                     // standard deviation of the observed pixels
  double point_noise_mu = 0;                     // standard deviation of map point positions
  double outlier_share = 0;                      // share of the points that are displaced along a viewing ray
  int mask_jitter_px = 0;                        // maximum dilation or erosion of the masks, random in each frame
  double dropped_mask_share = 0;                 // share of the masks that are missing
  double wrong_class_share = 0;                  // share of the detections with a wrong class name
  bool permute_labels = true;                    // permute the labels in every frame
  bool with_depth = false;                       // frames carry exact dense depth
  // Masks of objects that do not exist: frame index and rectangle [px]. Their class is kFalseDetectionClass.
  std::vector<std::pair<int, cv::Rect>> false_detections;
  uint64_t seed = 1;
};

// A book, a cup, a ball and a carton, apart from each other.
std::vector<SyntheticObject> DefaultSyntheticObjects();

// Deterministic for the same options. Frames may be requested in any order.
class SyntheticWorld {
 public:
  explicit SyntheticWorld(SyntheticWorldOptions options);

  int frame_count() const { return options_.frames; }
  const std::vector<SyntheticObject>& objects() const { return options_.objects; }
  const CameraModel& camera() const { return camera_; }
  bool IsKeyframe(int index) const { return index % options_.keyframe_every == 0; }

  // Camera pose, image, masks and detections of frame `index` in [0, frame_count()).
  TrackedFrame MakeFrame(int index) const;
  // The same frame with its sparse points. `tracked` is what MakeFrame(index) returned.
  KeyframeView MakeKeyframe(int index, const TrackedFrame& tracked) const;

  // True box of an object.
  Cuboid TrueCuboid(int object) const;
  // `count` random points on the surface of an object, in the World frame.
  std::vector<Eigen::Vector3d> SurfacePoints(int object, int count) const;

 private:
  struct Hit {
    int object = -1;  // -1: table or nothing
    double depth_mu = 0;
    Eigen::Vector3d point_scene = Eigen::Vector3d::Zero();
  };

  SE3<World, Camera> CameraPose(int index) const;
  // The first hit of a ray with the table or one of the candidate objects.
  Hit Cast(const Eigen::Vector3d& origin_scene, const Eigen::Vector3d& direction_scene,
           std::span<const int> candidates) const;
  // Pixels that may show the object; avoids intersections with objects elsewhere in the image.
  cv::Rect BoundsInImage(int object, const SE3<World, Camera>& T_world_camera) const;
  std::mt19937_64 Random(uint64_t stream, uint64_t index) const;
  void MakePoints();
  void RenderInto(const SE3<World, Camera>& T_world_camera, cv::Mat* image_bgr, cv::Mat* object_index,
                  cv::Mat* depth_mu) const;
  void DetectInto(int index, const cv::Mat& object_index, Frame* frame) const;

  struct SparsePoint {
    Eigen::Vector3d surface_world;  // true position
    Eigen::Vector3d mapped_world;   // position in the map
  };

  SyntheticWorldOptions options_;
  CameraModel camera_;
  Eigen::Matrix3d R_world_scene_;
  std::vector<Eigen::Matrix3d> R_object_scene_;  // per object
  std::vector<int> all_objects_;                 // 0, 1, ..
  std::vector<SparsePoint> points_;
};

// Intersection over union of two cuboids by counting grid samples (accurate to about 1 %).
double CuboidIou(const Cuboid& a, const Cuboid& b);

// Share of `points_world` inside the cuboid whose half extents are multiplied by `enlargement`.
double ContainedShare(const Cuboid& cuboid, std::span<const Eigen::Vector3d> points_world, double enlargement);

}  // namespace romap
