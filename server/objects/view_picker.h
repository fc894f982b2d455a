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

// A keyframe with a mask of an object: a candidate for a training view of the object's field.
struct ViewCandidate {
  KeyframeId keyframe;
  std::shared_ptr<const Frame> frame;
  SE3<World, Camera> T_world_camera;
  uint16_t label = 0;                      // of the object in this frame
  cv::Rect box_px;                         // of its mask
  std::vector<MapPointId> points;          // map points observed under the mask
  std::vector<Eigen::Vector2f> pixels_px;  // pixel of each of `points`
  std::vector<LandmarkKey> detected;       // landmarks with a mask in this frame
  std::vector<uint16_t> detected_labels;   // label of each of `detected`
};

// The object and its neighbors when views are picked.
struct ViewContext {
  ObjectId object;
  Cuboid cuboid;                                // the box the field trains in
  std::span<const Eigen::Vector3d> body_world;  // points spread over the object's volume
  std::span<const MapPointId> object_points;    // its map points without outliers, ascending
  const PointRegistry* registry = nullptr;
  struct Neighbor {
    LandmarkKey key;
    Cuboid cuboid;
  };
  std::span<const Neighbor> neighbors;  // the other confirmed objects
};

// Picks the training views of one object from its keyframes. The paper picks a keyframe whose direction differs by 25
// degrees from that of the last view. Here it must differ by ObjectsConfig::view_angle_deg from every view, or be at a
// clearly different distance. The angle can be smaller, because a camera that returns to an earlier direction adds no
// views. The first few views may be closer together, so that a first shape is available early even if the camera moves
// slowly. Keyframes are rejected if their mask contradicts the object's shape, if they show too little of it, or if
// they are blurred while a sharper one may still arrive. No views are picked beyond ObjectsConfig::max_views, because
// sent views cannot be withdrawn.
class ViewPicker {
 public:
  explicit ViewPicker(const ObjectsConfig& config) : config_(config) {}

  // Keeps the candidate until the next Take(). When too many are waiting, every second one is dropped, which preserves
  // their distribution.
  void Offer(ViewCandidate candidate);
  // Picks views from the waiting candidates, oldest first, and drops the others.
  std::vector<ObjectView> Take(const ViewContext& context);
  // Adds the views and candidates of an object that was merged into this one. Returns the added views as views of
  // `object`.
  std::vector<ObjectView> Adopt(ViewPicker&& other, ObjectId object, const Eigen::Vector3d& center_world);

  // Applies a map correction: the space around the object moved by `S_new_old`, and keyframes have new poses.
  void Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes);
  // The views whose pose relative to the object (`cuboid`, corrected) changed noticeably since it was last returned
  // here or by Take(). Smaller changes add up.
  std::vector<ViewPose> TakeCorrectedPoses(const Cuboid& cuboid);

  // Replaces `from` by `into` after the merge of these landmarks.
  void RenameNeighbor(LandmarkKey from, LandmarkKey into);

 private:
  struct Picked {
    ObjectView view;  // shares its pixels with the view that was sent
    // The pose at the receiver, which moves the view with the object.
    SE3<World, Camera> sent_T_world_camera;
  };

  bool IsNewDirection(const Eigen::Vector3d& camera_center, const Eigen::Vector3d& object_center,
                      double angle_rad) const;
  // Whether the candidate is sharp compared with earlier candidates. Call only for new directions, because it reads all
  // pixels of the box.
  bool IsSharp(const ViewCandidate& candidate);

  ObjectsConfig config_;
  std::vector<ViewCandidate> waiting_;
  std::vector<double> sharpness_history_;
  std::vector<Picked> picked_;
};

}  // namespace romap::objects
