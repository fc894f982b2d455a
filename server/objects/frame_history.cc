#include "server/objects/frame_history.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "common/label_image.h"

namespace romap::objects {
namespace {

// Ids of stand-in keyframes must differ from those of the camera's map, which count from 1.
constexpr uint64_t kFirstStandIn = uint64_t{1} << 62;
constexpr int kMaskErosion_px = 2;  // a point nearer to the border of a mask gets no label

}  // namespace

void FrameHistory::Add(const TrackedFrame& tracked) {
  const Frame& frame = *tracked.frame;
  entries_.push_back({.tracked = tracked,
                      .frame_id = frame.frame_id,
                      .timestamp_ns = frame.timestamp_ns,
                      .has_masks = frame.has_masks,
                      .keyframe = {},
                      .observations = {}});
  if (frame.has_masks) entries_.back().tracked.frame = nullptr;
  const auto retention_ns = static_cast<int64_t>(1e9 * retention_s_);
  while (entries_.size() > 1 && frame.timestamp_ns - entries_.front().timestamp_ns > retention_ns) entries_.pop_front();
}

void FrameHistory::AddKeyframe(const KeyframeView& view) {
  if (entries_.empty() || !view.frame || entries_.back().frame_id != view.frame->frame_id) return;
  Entry& entry = entries_.back();
  entry.is_keyframe = true;
  entry.keyframe = view.id;
  entry.tracked.T_world_camera = view.T_world_camera;
  entry.tracked.up_world = view.up_world;
  entry.observations = view.observations;
}

std::optional<FrameHistory::Masked> FrameHistory::AddLateMasks(const FrameMasks& masks) {
  const auto entry =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.frame_id == masks.frame_id; });
  if (entry == entries_.end() || entry->has_masks) return std::nullopt;
  auto frame = std::make_shared<Frame>(*entry->tracked.frame);
  frame->has_masks = true;
  frame->labels = masks.labels;
  frame->instances = masks.instances;
  frame->non_objects = masks.non_objects;
  entry->has_masks = true;
  Masked masked{.tracked = entry->tracked, .view = {}};
  entry->tracked.frame = nullptr;
  masked.tracked.frame = frame;
  if (!entry->is_keyframe) return masked;
  KeyframeView& view = masked.view.emplace();
  view.id = entry->keyframe;
  view.frame = frame;
  view.T_world_camera = entry->tracked.T_world_camera;
  view.up_world = entry->tracked.up_world;
  view.observations = entry->observations;
  for (PointObservation& observation : view.observations)
    observation.label = LabelAt(masks.labels, observation.pixel_px, kMaskErosion_px);
  return masked;
}

const FrameHistory::Entry* FrameHistory::NearestKeyframe(int64_t timestamp_ns) const {
  const Entry* nearest = nullptr;
  const auto gap_ns = [&](const Entry& entry) { return std::abs(entry.timestamp_ns - timestamp_ns); };
  for (const Entry& entry : entries_) {
    if (entry.is_keyframe && (nearest == nullptr || gap_ns(entry) < gap_ns(*nearest))) nearest = &entry;
  }
  return nearest;
}

// Marks all keyframes without masks up to `until_ns` as replaced. Returns whether any of them was not replaced before.
bool FrameHistory::MarkReplaced(int64_t until_ns) {
  bool any = false;
  for (Entry& entry : entries_) {
    if (entry.timestamp_ns > until_ns || !entry.is_keyframe || entry.has_masks || entry.replaced) continue;
    entry.replaced = true;
    any = true;
  }
  return any;
}

std::optional<KeyframeView> FrameHistory::MakeStandIn(const TrackedFrame& masked, const PointRegistry& points) {
  const Frame& frame = *masked.frame;
  if (!MarkReplaced(frame.timestamp_ns)) return std::nullopt;
  KeyframeView view;
  view.id = KeyframeId{kFirstStandIn + ++stand_ins_made_};
  view.frame = masked.frame;
  view.T_world_camera = masked.T_world_camera;
  view.up_world = masked.up_world;
  if (masked.reference) stand_ins_[view.id] = {masked.reference, masked.T_world_camera};
  const Entry* source = NearestKeyframe(frame.timestamp_ns);
  const SE3<Camera, World> T_camera_world = masked.T_world_camera.Inverse();
  for (const PointObservation& observation : source->observations) {
    const Eigen::Vector3d* p_world = points.Find(observation.point);
    if (p_world == nullptr) continue;
    const Eigen::Vector3d p_camera = T_camera_world * *p_world;
    if (!(p_camera.z() > 1e-9)) continue;
    const Eigen::Vector2f pixel_px = frame.camera.Project(p_camera).cast<float>();
    const bool inside = pixel_px.x() >= 0 && pixel_px.y() >= 0 && pixel_px.x() <= frame.camera.width_px - 1 &&
                        pixel_px.y() <= frame.camera.height_px - 1;
    if (!inside) continue;
    const uint16_t label = LabelAt(frame.labels, pixel_px, kMaskErosion_px);
    view.observations.push_back({.point = observation.point, .pixel_px = pixel_px, .label = label});
  }
  return view;
}

void FrameHistory::Correct(KeyframeCorrections* corrections) {
  for (auto& [id, pose] : stand_ins_) {
    const auto moved = corrections->find(pose.reference);
    if (moved == corrections->end()) continue;
    const Sim3<World, World> S_new_old = moved->second.S_new_old;
    pose.T_world_camera = S_new_old.Moved(pose.T_world_camera);
    (*corrections)[id] = {.id = id, .T_world_camera = pose.T_world_camera, .S_new_old = S_new_old};
  }
  for (Entry& entry : entries_) {
    const auto moved = corrections->find(entry.is_keyframe ? entry.keyframe : entry.tracked.reference);
    if (moved == corrections->end()) continue;
    entry.tracked.T_world_camera =
        entry.is_keyframe ? moved->second.T_world_camera : moved->second.S_new_old.Moved(entry.tracked.T_world_camera);
  }
}

}  // namespace romap::objects
