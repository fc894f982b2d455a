#include "server/slam/mask_voter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/label_image.h"

namespace romap::slam {
namespace {

// 17 s at 30 frames/s, longer than any detector takes.
constexpr size_t kMaxWaitingFrames = 512;

MapKeyframe* FindKeyframeOfFrame(uint64_t frame_id, SlamMap& map) {
  // Late masks belong to recent keyframes, so the search starts with the newest. Keyframes are in frame order.
  for (auto it = map.keyframes().rbegin(); it != map.keyframes().rend(); ++it) {
    const uint64_t keyframe_frame_id = it->second.frame->frame_id;
    if (keyframe_frame_id == frame_id) return &it->second;
    if (keyframe_frame_id < frame_id) break;
  }
  return nullptr;
}

}  // namespace

void MaskVoter::ObserveFrame(const TrackedFrame& tracked, SlamMap& map) {
  if (!tracked.reference) return;
  const Frame& frame = *tracked.frame;
  const WaitingFrame waiting{.frame_id = frame.frame_id,
                             .camera = frame.camera,
                             .reference = tracked.reference,
                             .T_reference_camera = tracked.T_reference_camera};
  if (frame.has_masks) return Vote(waiting, frame.labels, map);
  waiting_.push_back(waiting);
  if (waiting_.size() > kMaxWaitingFrames) waiting_.pop_front();
}

void MaskVoter::ObserveMasks(const FrameMasks& masks, SlamMap& map) {
  if (MapKeyframe* keyframe = FindKeyframeOfFrame(masks.frame_id, map)) {
    if (!keyframe->frame->has_masks) {
      keyframe->frame = WithMasks(*keyframe->frame, masks.labels, config_.mask_erosion_px);
    }
    return;
  }
  const auto waiting =
      std::ranges::find_if(waiting_, [&](const WaitingFrame& frame) { return frame.frame_id == masks.frame_id; });
  if (waiting == waiting_.end()) return;
  Vote(*waiting, masks.labels, map);
  waiting_.erase(waiting);
}

void MaskVoter::Vote(const WaitingFrame& frame, const cv::Mat& labels, SlamMap& map) const {
  const MapKeyframe* reference = map.FindKeyframe(frame.reference);
  if (reference == nullptr || reference->frame->has_masks || labels.empty()) return;
  const SE3<Camera, World> T_camera_world =
      ScaleTranslation(frame.T_reference_camera, reference->scale).Inverse() * reference->T_camera_world();
  const MaskZones zones(labels);
  for (const MapPointId id : reference->points) {
    if (!id) continue;
    PointTrack& track = *map.FindPoint(id);
    const Eigen::Vector3d p_camera = T_camera_world * track.point.position_world;
    if (!(p_camera.z() > 1e-9)) continue;
    const Eigen::Vector2f pixel_px = map.lens().Distort(frame.camera, frame.camera.Project(p_camera)).cast<float>();
    const bool inside = pixel_px.x() >= 0 && pixel_px.y() >= 0 && pixel_px.x() <= static_cast<float>(labels.cols - 1) &&
                        pixel_px.y() <= static_cast<float>(labels.rows - 1);
    if (!inside) continue;
    const double octave_scale = std::clamp(track.size_mu * frame.camera.fx_px / p_camera.norm(), 1.0, kMaxOctaveScale);
    const int erosion_px = static_cast<int>(std::lround(config_.mask_erosion_px * octave_scale));
    track.votes.Add(zones.At(pixel_px, octave_scale, LabelAt(labels, pixel_px, erosion_px)));
  }
}

}  // namespace romap::slam
