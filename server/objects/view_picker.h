#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core/types.hpp>
#include <span>
#include <vector>

#include "common/cuboid.h"
#include "common/stage_messages.h"
#include "server/objects/correction.h"
#include "server/objects/objects_config.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// A keyframe in which an object was seen, before it is decided whether the field of the object trains on it.
struct ViewCandidate {
  KeyframeId keyframe;
  std::shared_ptr<const Frame> frame;
  SE3<World, Camera> T_world_camera;
  uint16_t label = 0;                      // of the object in this frame
  cv::Rect box_px;                         // of its mask
  std::vector<MapPointId> points;          // map points seen under the mask
  std::vector<Eigen::Vector2f> pixels_px;  // where, as long as `points`
  std::vector<LandmarkKey> detected;       // landmarks that have a mask in this frame
  std::vector<uint16_t> detected_labels;   // their labels, as long as `detected`
};

// What is known of the object and its neighbours when views are picked.
struct ViewContext {
  ObjectId object;
  Cuboid cuboid;
  std::span<const Eigen::Vector3d> body_world;  // points spread over the object's volume
  std::span<const MapPointId> object_points;    // its map points without outliers, ascending
  const PointRegistry* registry = nullptr;
  struct Neighbour {
    LandmarkKey key;
    Cuboid cuboid;
  };
  std::span<const Neighbour> neighbours;  // the other objects that have a cuboid
};

// Variance of the Laplacian of the grey image inside `box_px`: small for blurred pictures. Source: J. L. Pech-Pacheco
// et al., "Diatom autofocusing in brightfield microscopy", ICPR 2000.
double MeasureSharpness(const cv::Mat& image_bgr, const cv::Rect& box_px);

// Picks the training views of one object out of its keyframes. The paper takes a keyframe when its direction differs by
// 25 degrees from the last view's; here it must differ by `view_angle_deg` from every view (or stand at a quite
// different distance), so that a camera that comes back adds nothing, and a smaller angle is affordable. The first few
// come closer together, so that a slow camera need not go far before there is a first shape. Left out: keyframes whose
// mask contradicts the object's shape, those that show too little of it, and blurred ones as long as a sharper one may
// still come. At `max_views` the picker is done: views were already sent and cannot be taken back.
class ViewPicker {
 public:
  explicit ViewPicker(const ObjectsConfig& config) : config_(config) {}

  // Keeps the candidate until the next Take(). When too many wait, every second is dropped, which keeps their spread.
  void Offer(ViewCandidate candidate);
  // Views among the waiting candidates, oldest first; none are left waiting.
  std::vector<ObjectView> Take(const ViewContext& context);
  // Takes over the views of an object that turned out to be this one; returns those that were new to this one, renamed.
  std::vector<ObjectView> Adopt(ViewPicker&& other, ObjectId object, const Eigen::Vector3d& center_world);

  // The map was corrected: `S_new_old` happened to the object's space, and keyframes have new poses.
  void Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes);
  // The views that stand noticeably elsewhere against the object, a `cuboid` of the present, than was told; smaller
  // changes wait until they have added up. The answer counts as told.
  std::vector<ViewPose> TakeCorrectedPoses(const Cuboid& cuboid);

  // Landmark `from` is called `into` from now on.
  void RenameNeighbour(LandmarkKey from, LandmarkKey into);

  size_t count() const { return taken_.size(); }

 private:
  struct Taken {
    ObjectView view;  // pixels are shared with what was sent
    // Its pose as the receiver has it, once it has moved the view along with the object.
    SE3<World, Camera> told_T_world_camera;
  };

  bool IsNewDirection(const Eigen::Vector3d& camera_center, const Eigen::Vector3d& object_center,
                      double angle_rad) const;
  // Against those that were asked about before; measured only when it matters, since it takes all the mask's pixels.
  bool IsSharp(const ViewCandidate& candidate);

  ObjectsConfig config_;
  std::vector<ViewCandidate> waiting_;
  std::vector<double> sharpness_history_;
  std::vector<Taken> taken_;
};

}  // namespace romap::objects
