#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "common/cuboid.h"
#include "common/map_events.h"
#include "common/stage_messages.h"
#include "server/objects/association.h"
#include "server/objects/correction.h"
#include "server/objects/detections.h"
#include "server/objects/frame_history.h"
#include "server/objects/landmark.h"
#include "server/objects/object_output.h"
#include "server/objects/objects_config.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// Maps objects: follows instance masks from frame to frame, decides which are things, says where they are and how
// large, and picks the pictures their fields train on. Source: section "Lightweight Object SLAM" of the RO-MAP paper;
// what is different and why is said where it is done (association.h, cuboid_fitter.h, view_picker.h).
//
// Single-threaded and deterministic: equal input gives equal output. Frames with an uncertain pose (initialising, lost
// or not finite) and masks that do not fit the image are passed over.
class ObjectMapper {
 public:
  explicit ObjectMapper(ObjectsConfig config) : config_(config), history_(config.max_mask_delay_s) {}

  // Every frame, in order.
  ObjectOutput ObserveFrame(const TrackedFrame& tracked);
  // Right after ObserveFrame of the same frame, when it is a keyframe.
  ObjectOutput ObserveKeyframe(const KeyframeView& view);
  // Masks of an earlier frame that had none, in the order of their frames; passed over when they are older than
  // ObjectsConfig::max_mask_delay_s or the camera's pose was not known. Not between ObserveFrame and ObserveKeyframe.
  ObjectOutput ObserveLateMasks(const FrameMasks& masks);
  // The map was corrected, as the stage before this one says of what it handed on so far. Each object goes along with
  // the keyframes that saw it (MeanMotion). What changed noticeably is told: the cuboid in an ObjectUpdate, and to the
  // field, in ObjectViews, the motion of the object's space and the views that moved against the object.
  ObjectOutput Correct(const MapCorrection& correction);
  // The map was begun anew and all poses so far are void: every object goes. Ids are not used again.
  ObjectOutput Reset();
  // No more frames: the last fits and all views that still wait.
  ObjectOutput Finish();

 private:
  struct CurrentFrame {
    bool usable = false;
    uint64_t frame_id = 0;
    std::vector<Detection> detections;
    std::vector<LandmarkKey> keys;  // per detection: its landmark, if only a provisional one, or kNobody
    std::vector<bool> certain;      // per detection: good enough to learn from
  };
  static constexpr LandmarkKey kNobody = ~LandmarkKey{0};  // of a mask that is no thing of its own
  using PointGroups = std::map<LandmarkKey, std::vector<PointRegistry::Member>>;

  // Per frame.
  ObjectOutput ObserveMaskedFrame(const TrackedFrame& tracked);
  void RecordSighting(Landmark& landmark, const Detection& detection, const TrackedFrame& tracked);
  void RecordCompany(const Association& association, size_t landmarks_before);
  void UpdateLost(const Association& association, ObjectOutput* output);
  void BuryGhosts(ObjectOutput* output);
  // Takes out the landmarks for which `why` gives a reason.
  void Bury(const std::function<const char*(const Landmark&)>& why, ObjectOutput* output);
  const char* WhyGhost(const Landmark& landmark) const;

  // Per keyframe.
  ObjectOutput ObserveMaskedKeyframe(const KeyframeView& view);
  void CountPointVotes(const KeyframeView& view);
  void UpdateSceneDepth(const KeyframeView& view);
  struct KeptSilhouette {
    Landmark* landmark = nullptr;
    const Detection* detection = nullptr;
    Silhouette silhouette;
  };
  void CollectSilhouettes(const KeyframeView& view);
  // Looks for straight edges where they tell most.
  void FindSegments(const KeyframeView& view, std::vector<KeptSilhouette>* kept) const;
  void OfferViews(const KeyframeView& view);
  std::map<LandmarkKey, Cuboid> PublishedCuboids() const;
  // The neediest landmarks get new boxes; returns their keys.
  std::vector<LandmarkKey> FitNeediest();
  void FitAll();
  // In this order, until `most` boxes were found; returns whose.
  std::vector<LandmarkKey> FitShapes(const std::vector<LandmarkKey>& keys, size_t most);
  // False when the evidence does not suffice for a box.
  bool FitShape(Landmark& landmark, const PointGroups& groups, const std::vector<Eigen::Vector3d>& background);
  bool IsSteady(const Landmark& landmark) const;
  bool IsProven(const Landmark& landmark) const;
  void ConfirmProven(const std::vector<LandmarkKey>& keys);
  void MergeDuplicates(ObjectOutput* output);
  void Merge(Landmark& from, Landmark& into, ObjectOutput* output);
  struct Company {
    uint64_t together = 0;  // frames in which both had a mask
    uint64_t covered = 0;   // frames in which one had none and the other one's mask lay over it
  };
  static Company CompanyOf(const Landmark& a, const Landmark& b);
  bool AreTheSame(const Landmark& a, const Landmark& b) const;
  std::optional<bool> PointsAgree(const Landmark& a, const Landmark& b) const;
  std::vector<Eigen::Vector3d> PointsOf(const Landmark& landmark) const;
  bool IsAnnounceable(const Landmark& landmark) const;
  void Publish(Landmark& landmark, bool force, ObjectOutput* output);
  std::vector<ObjectView> TakeViews(Landmark& landmark, const Cuboid& cuboid);
  void PublishAll(const std::vector<LandmarkKey>& keys, ObjectOutput* output);

  // Per correction.
  void CorrectLandmark(Landmark& landmark, const KeyframeCorrections& keyframes);
  Cuboid ToldCuboid(const Landmark& landmark) const;

  Landmark* FindLandmark(LandmarkKey key);

  ObjectsConfig config_;
  std::vector<std::unique_ptr<Landmark>> landmarks_;  // by key
  PointRegistry registry_;
  FrameHistory history_;
  CurrentFrame current_;
  Eigen::Vector3d up_world_ = Eigen::Vector3d::UnitZ();
  uint64_t frame_index_ = 0;
  KeyframeId last_keyframe_;
  double scene_depth_mu_ = 0;  // median depth of the map points in the last keyframe; 0 = unknown
  LandmarkKey last_key_ = 0;
  uint64_t last_id_ = 0;
};

}  // namespace romap::objects
