#pragma once

#include <cstdint>
#include <vector>

#include "common/diagnostic.h"
#include "common/stage_messages.h"
#include "server/objects/association.h"
#include "server/objects/confirmation_report.h"
#include "server/objects/frame_detections.h"
#include "server/objects/frame_history.h"
#include "server/objects/landmark_store.h"
#include "server/objects/object_output.h"
#include "server/objects/object_publisher.h"
#include "server/objects/objects_config.h"
#include "server/objects/scene_depth.h"
#include "server/objects/shape_fitter.h"

namespace romap::objects {

// Maps objects: tracks instance masks from frame to frame, decides which of them are real objects, fits a cuboid to
// each, and selects the training views of its field. Source: section "Lightweight Object SLAM" of the RO-MAP paper;
// differences are explained in association.h, cuboid_fitter.h and view_picker.h.
//
// The map that TrackedFrame::map names is the current one. Landmarks of other maps are dormant until the camera returns
// to their map or the maps are merged: they stay as they are and remain published.
//
// Landmarks that were first observed since poses or depth images contradict the images are removed
// (TrackedFrame::contradicted_since_frame).
//
// Single-threaded and deterministic: equal input gives equal output. Frames without a reliable pose (initializing, lost
// or not finite) and masks whose size differs from the image are ignored.
class ObjectMapper {
 public:
  explicit ObjectMapper(const ObjectsConfig& config);

  // Processes a frame. Call for every frame, in order.
  ObjectOutput ObserveFrame(const TrackedFrame& tracked);
  // Processes a keyframe. Call right after ObserveFrame for the same frame.
  ObjectOutput ObserveKeyframe(const KeyframeView& view);
  // Processes masks of an earlier frame that had none. Call in the order of the frames, but not between ObserveFrame
  // and ObserveKeyframe of one frame. Masks are ignored when they are older than ObjectsConfig::max_mask_delay_s, the
  // frame has no pose, or the camera has been in another map since.
  ObjectOutput ObserveLateMasks(const FrameMasks& masks);
  // Applies a map correction. Each object moves with the keyframes that observed it (MeanMotion). If two maps were
  // merged, the landmarks of both are compared again (MergeDuplicates). Noticeable changes are published: the cuboid in
  // an ObjectUpdate; in ObjectViews the motion of the object's space and the views that moved relative to the object.
  ObjectOutput Correct(const MapCorrection& correction);
  // Call after the last frame. Performs the last fits and publishes all pending views and corrections.
  ObjectOutput Finish();
  // Call after Finish().
  std::vector<Diagnostic> Diagnostics() const;

 private:
  void SetMap(SparseMapId map);
  ObjectOutput RemoveContradicted(const TrackedFrame& tracked);

  // Steps that process a frame with masks.
  ObjectOutput ObserveMaskedFrame(const TrackedFrame& tracked);
  void RemoveNonObjects(const std::vector<NonObjectMask>& masks, ObjectOutput* output);
  void UpdateMissed(const Association& association, ObjectOutput* output);
  void RecordObservations(const Association& association, const TrackedFrame& tracked, ObjectOutput* output);
  void RecordObservation(const Match& match, const Detection& detection, const TrackedFrame& tracked,
                         ObjectOutput* output);
  void PruneFalseLandmarks(ObjectOutput* output);

  // Steps that process a keyframe with masks.
  ObjectOutput ObserveMaskedKeyframe(const KeyframeView& view);
  void Confirm(const std::vector<LandmarkKey>& keys);
  void MergeDuplicates(ObjectOutput* output);
  void Merge(Landmark& from, Landmark& into, ObjectOutput* output);
  void PublishChanges(const std::vector<LandmarkKey>& keys, ObjectOutput* output);

  void FinishMap(ObjectOutput* output);
  void ReportConfirmation();

  template <class DecisionFunction>
  void Prune(const DecisionFunction& decide, ObjectOutput* output);

  ObjectsConfig config_;
  LandmarkStore store_;
  ObjectPublisher publisher_;
  ShapeFitter fitter_;
  FrameHistory history_;
  SceneDepth scene_depth_;
  FrameDetections current_;
  ConfirmationReport confirmation_;
  uint64_t frame_index_ = 0;  // of frames with pose and masks
};

}  // namespace romap::objects
