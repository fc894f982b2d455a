#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "common/stage_messages.h"
#include "server/objects/correction.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// Keeps the newest frames for which masks may still arrive, and replaces keyframes without masks.
//
// Objects are mapped from keyframes, but a slow detector provides masks for some frames only, and most of these are not
// keyframes of the camera's map. Therefore the first masked frame after a keyframe without masks replaces it as a
// stand-in: a keyframe for objects only. The stand-in observes the points of the nearest keyframe, and its pose is
// anchored to the same keyframe as that of its frame, so that it follows corrections.
class FrameHistory {
 public:
  // `retention_s`: how long a frame without masks is kept, with its image, measured by the timestamps of the frames.
  explicit FrameHistory(double retention_s) : retention_s_(retention_s) {}

  // Adds a frame. Call for every frame with a pose, in order.
  void Add(const TrackedFrame& tracked);
  // Adds the keyframe made from the last added frame.
  void AddKeyframe(const KeyframeView& view);

  struct Masked {
    TrackedFrame tracked;
    std::optional<KeyframeView> view;  // if it is a keyframe; its observations have labels
  };
  // Adds late masks to their frame. nullopt if the frame is unknown, too old, or already has masks.
  std::optional<Masked> AddLateMasks(const FrameMasks& masks);

  // Returns a keyframe made from a masked frame that is not a keyframe; nullopt unless it replaces a keyframe without
  // masks.
  std::optional<KeyframeView> MakeStandIn(const TrackedFrame& masked, const PointRegistry& points);

  // Applies a map correction to the stored frames. Adds the corrections of stand-ins to `corrections`.
  void Correct(KeyframeCorrections* corrections);
  // Forgets the frames, but keeps the poses of stand-ins, which corrections still move.
  void ForgetFrames() { entries_.clear(); }

 private:
  struct Entry {
    TrackedFrame tracked;  // its frame is null once it has masks
    uint64_t frame_id = 0;
    int64_t timestamp_ns = 0;
    bool has_masks = false;
    bool is_keyframe = false;
    bool replaced = false;  // a keyframe with a stand-in
    KeyframeId keyframe;
    std::vector<PointObservation> observations;  // empty unless it is a keyframe
  };
  struct StandInPose {
    KeyframeId reference;  // the keyframe it is anchored to
    SE3<World, Camera> T_world_camera;
  };

  const Entry* NearestKeyframe(int64_t timestamp_ns) const;
  bool MarkReplaced(int64_t until_ns);

  double retention_s_;
  std::deque<Entry> entries_;
  std::map<KeyframeId, StandInPose> stand_ins_;
  uint64_t stand_ins_made_ = 0;
};

}  // namespace romap::objects
