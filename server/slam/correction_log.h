#pragma once

#include <map>
#include <unordered_map>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Records which keyframe poses and point positions later stages have, and reports which of them have changed
// noticeably. Changes too small to report accumulate until they are noticeable.
class CorrectionLog {
 public:
  // Records a keyframe that is passed to later stages. `scale`: see ScaledPose.
  void Record(const KeyframeView& view, double scale);
  // Adds the records of another map that was merged into this one.
  void Append(CorrectionLog other);
  // Returns all keyframes and points that moved noticeably since they were recorded or last returned.
  MapCorrection TakeCorrection(const SlamMap& map);
  // Of all recorded keyframes.
  std::map<KeyframeId, PoseUncertainty> Uncertainties(const SlamMap& map) const;

 private:
  struct RecordedKeyframe {
    ScaledPose pose;
    double depth_mu = 0;  // median of its points; scales the smallest noticeable translation
  };
  struct RecordedPoint {
    Eigen::Vector3d position_world;
    double noticeable_mu = 0;
  };

  std::map<KeyframeId, RecordedKeyframe> keyframes_;
  std::map<MapPointId, RecordedPoint> points_;
};

}  // namespace romap::slam
