#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "common/stage_messages.h"
#include "server/objects/correction.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// The newest frames, as long as masks may still come for them, and what to do about keyframes without masks.
//
// Objects learn from keyframes, but a slow detector has masks for some frames only, and those are mostly not the
// keyframes of the camera's map. So the first masked frame after a keyframe without masks stands in for it: it counts
// as a keyframe of objects only. It sees the points that the nearest keyframe saw, and hangs on the keyframe that its
// frame hangs on: where that one goes, it goes.
class FrameHistory {
 public:
  // `patience_s`: of frame timestamps. A frame without masks is kept so long, with its picture.
  explicit FrameHistory(double patience_s) : patience_s_(patience_s) {}

  // Every frame with a pose, in order.
  void Add(const TrackedFrame& tracked);
  // The keyframe of the frame that was added last.
  void AddKeyframe(const KeyframeView& view);

  struct Masked {
    TrackedFrame tracked;
    std::optional<KeyframeView> view;  // of a keyframe: its observations have their labels now
  };
  // Gives a frame the masks that came late. nullopt when the frame is not known any more, or had masks before.
  std::optional<Masked> TakeLateMasks(const FrameMasks& masks);

  // The keyframe that a masked frame, one that is none, stands in for; nullopt while nothing asks for it.
  std::optional<KeyframeView> StandIn(const TrackedFrame& masked, const PointRegistry& points);

  // The map was corrected. Adds what became of the stand-ins to `corrections`.
  void Correct(KeyframeCorrections* corrections);
  void Clear();

 private:
  struct Entry {
    TrackedFrame tracked;  // without its frame once masks are there
    uint64_t frame_id = 0;
    int64_t timestamp_ns = 0;
    bool has_masks = false;
    bool is_keyframe = false;
    bool replaced = false;  // a keyframe that another frame stood in for
    KeyframeId keyframe;
    std::vector<PointObservation> observations;  // of a keyframe
  };
  struct StandInPlace {
    KeyframeId reference;
    SE3<World, Camera> T_world_camera;
  };

  const Entry* NearestKeyframe(int64_t timestamp_ns) const;
  bool TakeUnmaskedKeyframes(int64_t until_ns);

  double patience_s_;
  std::deque<Entry> entries_;
  std::map<KeyframeId, StandInPlace> stand_ins_;
  uint64_t stand_ins_made_ = 0;
};

}  // namespace romap::objects
