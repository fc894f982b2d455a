#include "server/session/trajectory.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <iterator>

namespace romap::session {

void Trajectory::Add(const TrackedPose& tracked) {
  if (tracked.reference) {
    keyframes_.try_emplace(tracked.reference,
                           ScaledPose{tracked.T_world_camera * tracked.T_reference_camera.Inverse()});
  }
  frames_.push_back(tracked);
}

void Trajectory::SetKeyframe(uint64_t frame_id, int64_t timestamp_ns, KeyframeId keyframe,
                             const SE3<World, Camera>& T_world_camera) {
  keyframes_[keyframe].T_world_camera = T_world_camera;
  keyframe_timestamps_ns_[keyframe] = timestamp_ns;
  keyframe_of_frame_[frame_id] = keyframe;
}

void Trajectory::Correct(const MapCorrection& correction) {
  for (const KeyframeCorrection& keyframe : correction.keyframes) {
    ScaledPose& pose = keyframes_[keyframe.id];
    pose.T_world_camera = keyframe.T_world_camera;
    pose.scale *= keyframe.S_new_old.scale();
    const auto uncertainty = uncertainties_.find(keyframe.id);
    if (uncertainty != uncertainties_.end()) uncertainty->second.position_sigma_mu *= keyframe.S_new_old.scale();
  }
  for (const auto& [id, uncertainty] : correction.uncertainties) uncertainties_[id] = uncertainty;
}

std::vector<SE3<World, Camera>> Trajectory::Poses() const {
  const RelativeCorrections corrections = CorrectionsOfKeyframes();
  std::vector<SE3<World, Camera>> poses;
  poses.reserve(frames_.size());
  for (const TrackedPose& frame : frames_) {
    const auto keyframe = keyframe_of_frame_.find(frame.frame_id);
    if (keyframe != keyframe_of_frame_.end()) {
      poses.push_back(keyframes_.at(keyframe->second).T_world_camera);
    } else if (frame.reference) {
      const auto of_reference = corrections.find(frame.reference);
      const SE3<Camera, Camera> correction = of_reference == corrections.end()
                                                 ? SE3<Camera, Camera>()
                                                 : Interpolate(of_reference->second, frame.timestamp_ns);
      poses.push_back(keyframes_.at(frame.reference).Compose(frame.T_reference_camera * correction));
    } else {
      poses.push_back(frame.T_world_camera);
    }
  }
  return poses;
}

Trajectory::RelativeCorrections Trajectory::CorrectionsOfKeyframes() const {
  RelativeCorrections corrections;
  // A keyframe needs no correction relative to itself.
  for (const auto& [id, timestamp_ns] : keyframe_timestamps_ns_) corrections[id].push_back({timestamp_ns, {}});
  for (const TrackedPose& frame : frames_) {
    const auto keyframe = keyframe_of_frame_.find(frame.frame_id);
    if (keyframe == keyframe_of_frame_.end() || !frame.reference) continue;
    const SE3<Camera, Camera> T_reference_camera =
        keyframes_.at(frame.reference).Relative(keyframes_.at(keyframe->second).T_world_camera);
    corrections[frame.reference].push_back(
        {frame.timestamp_ns, frame.T_reference_camera.Inverse() * T_reference_camera});
  }
  return corrections;
}

// The frame must have an uncertainty.
FrameUncertainty Trajectory::CurrentUncertainty(const TrackedPose& frame) const {
  const auto keyframe = keyframe_of_frame_.find(frame.frame_id);
  const auto reference = uncertainties_.find(keyframe == keyframe_of_frame_.end() ? frame.reference : keyframe->second);
  const double scale = keyframes_.at(frame.reference).scale;
  if (reference == uncertainties_.end()) {
    PoseUncertainty tracked = *frame.uncertainty;
    tracked.position_sigma_mu *= scale;
    return {.reference = tracked, .relative = {}};
  }
  // Also for a keyframe: errors of its own features, which the adjustment of the map shares with its neighbors.
  PoseUncertainty relative = frame.reference_uncertainty;
  relative.position_sigma_mu *= scale;
  return {.reference = reference->second, .relative = relative};
}

std::vector<std::optional<PoseUncertainty>> Trajectory::Uncertainties() const {
  const std::vector<SE3<World, Camera>> poses = Poses();
  std::vector<std::optional<PoseUncertainty>> uncertainties(frames_.size());
  std::vector<size_t> indices;
  std::vector<FrameUncertainty> sources;
  for (size_t i = 0; i < frames_.size(); ++i) {
    if (!frames_[i].uncertainty) continue;
    if (!frames_[i].reference) {
      uncertainties[i] = frames_[i].uncertainty;  // of a stored trajectory, which is final
      continue;
    }
    indices.push_back(i);
    sources.push_back(CurrentUncertainty(frames_[i]));
    sources.back().position_world = poses[i].translation();
  }
  const std::vector<PoseUncertainty> aligned = AlignedUncertainties(sources);
  for (size_t k = 0; k < indices.size(); ++k) uncertainties[indices[k]] = aligned[k];
  return uncertainties;
}

SE3<Camera, Camera> Trajectory::Interpolate(const std::vector<RelativeCorrection>& corrections, int64_t timestamp_ns) {
  const auto after = std::upper_bound(corrections.begin(), corrections.end(), timestamp_ns,
                                      [](int64_t time, const RelativeCorrection& c) { return time < c.timestamp_ns; });
  if (after == corrections.end()) return corrections.back().T_camera_corrected;
  if (after == corrections.begin()) return after->T_camera_corrected;
  const RelativeCorrection& before = *std::prev(after);
  const double share = static_cast<double>(timestamp_ns - before.timestamp_ns) /
                       static_cast<double>(after->timestamp_ns - before.timestamp_ns);
  const SE3<Camera, Camera>& a = before.T_camera_corrected;
  const SE3<Camera, Camera>& b = after->T_camera_corrected;
  return {a.rotation().slerp(share, b.rotation()), (1 - share) * a.translation() + share * b.translation()};
}

}  // namespace romap::session
