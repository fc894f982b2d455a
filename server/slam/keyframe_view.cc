#include "server/slam/keyframe_view.h"

namespace romap::slam {

KeyframeView MakeKeyframeView(const TrackedFrame& tracked, const MapKeyframe& keyframe, SlamMap& map) {
  KeyframeView view;
  view.id = keyframe.id;
  view.frame = tracked.frame;
  view.T_world_camera = keyframe.T_world_camera();
  view.up_world = tracked.up_world;
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    const Feature& feature = keyframe.features()[i];
    view.observations.push_back(
        {.point = keyframe.points[i], .pixel_px = keyframe.frame->image_px[i], .label = feature.label});
    view.points.push_back(map.FindPoint(keyframe.points[i])->point);
  }
  view.removed_points = map.TakeRemovedPoints();
  return view;
}

}  // namespace romap::slam
