#pragma once

#include <cstdint>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/association.h"
#include "server/objects/frame_detections.h"
#include "server/objects/frame_history.h"
#include "server/objects/landmark_store.h"
#include "server/objects/object_output.h"
#include "server/objects/object_publisher.h"
#include "server/objects/objects_config.h"
#include "server/objects/scene_depth.h"
#include "server/objects/shape_fitter.h"

namespace romap::objects {

// Maps objects: tracks instance masks from frame to frame, decides which are real objects, fits a cuboid to each, and
// picks the views that its field trains on. Source: section "Lightweight Object SLAM" of the RO-MAP paper; differences
// are explained in association.h, cuboid_fitter.h and view_picker.h.
//
// Single-threaded and deterministic: equal input gives equal output. Frames without a reliable pose (initializing, lost
// or not finite) and masks whose size differs from the image are ignored.
class ObjectMapper {
 public:
  explicit ObjectMapper(const ObjectsConfig& config);

  // Every frame, in order.
  ObjectOutput ObserveFrame(const TrackedFrame& tracked);
  // Right after ObserveFrame of the same frame, when it is a keyframe.
  ObjectOutput ObserveKeyframe(const KeyframeView& view);
  // Masks of an earlier frame that had none, in the order of their frames. Ignored when they are older than
  // ObjectsConfig::max_mask_delay_s or the frame has no pose. Not between ObserveFrame and ObserveKeyframe.
  ObjectOutput ObserveLateMasks(const FrameMasks& masks);
  // The map was corrected. Each object moves with the keyframes that observed it (MeanMotion). Noticeable changes are
  // published: the cuboid in an ObjectUpdate; in ObjectViews the motion of the object's space and the views that moved
  // relative to the object.
  ObjectOutput Correct(const MapCorrection& correction);
  // The map was reset, and all poses before are invalid: every object is removed. Ids are never reused.
  ObjectOutput Reset();
  // No more frames: the last fits, and all views and corrections that were held back.
  ObjectOutput Finish();

 private:
  // Steps of a frame with masks.
  ObjectOutput ObserveMaskedFrame(const TrackedFrame& tracked);
  void UpdateMissed(const Association& association, ObjectOutput* output);
  void RecordObservations(const Association& association, const TrackedFrame& tracked, ObjectOutput* output);
  void RecordObservation(const Match& match, const Detection& detection, const TrackedFrame& tracked,
                         ObjectOutput* output);
  void PruneFalseLandmarks(ObjectOutput* output);

  // Steps of a keyframe with masks.
  ObjectOutput ObserveMaskedKeyframe(const KeyframeView& view);
  void Confirm(const std::vector<LandmarkKey>& keys);
  void MergeDuplicates(ObjectOutput* output);
  void Merge(Landmark& from, Landmark& into, ObjectOutput* output);
  void PublishChanges(const std::vector<LandmarkKey>& keys, ObjectOutput* output);

  template <class DecisionFunction>
  void Prune(const DecisionFunction& decide, ObjectOutput* output);

  ObjectsConfig config_;
  LandmarkStore store_;
  ObjectPublisher publisher_;
  ShapeFitter fitter_;
  FrameHistory history_;
  SceneDepth scene_depth_;
  FrameDetections current_;
  uint64_t frame_index_ = 0;  // of frames with pose and masks
};

}  // namespace romap::objects
