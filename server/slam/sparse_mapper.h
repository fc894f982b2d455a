#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <vector>

#include "common/messages.h"
#include "server/slam/features/feature_extractor.h"
#include "server/slam/keyframe.h"
#include "server/slam/point_track.h"
#include "server/slam/slam_config.h"

namespace romap {

// Makes map points from keyframes with known poses. For one thread. The same keyframes give the same map.
//
// A point is tied to an object by the labels of its observations, one per keyframe that sees it. They are evidence, not
// verdicts: a label is 0 near a mask's border (see SlamConfig::mask_erosion_px) and in keyframes without masks.
class SparseMapper {
 public:
  explicit SparseMapper(SlamConfig config) : config_(config), extractor_(config) {}

  // Adds the keyframe, finds known points again, makes new ones, refines and culls. The view lists the points seen in
  // this keyframe; a point seen for the first time has at least two observations unless a depth image gave it.
  KeyframeView AddKeyframe(const TrackedFrame& tracked);

  size_t points() const { return tracks_.size(); }
  size_t keyframes() const { return static_cast<size_t>(keyframe_count_); }

 private:
  void FindKnownPoints(MapKeyframe& keyframe);
  void MakePointsByParallax(MapKeyframe& keyframe);
  void MakePointsByDepth(MapKeyframe& keyframe);
  std::vector<MapKeyframe*> KeyframesToMatch(const MapKeyframe& keyframe);
  PointTrack* MakePoint(MapKeyframe& keyframe, int feature, MapKeyframe& other, int other_feature);
  PointTrack& NewTrack(MapKeyframe& keyframe, int feature, const Eigen::Vector3d& p_world);
  bool Tie(MapKeyframe& keyframe, int feature, PointTrack& track);
  std::vector<MapPointId> Cull();
  KeyframeView MakeView(const TrackedFrame& tracked, const MapKeyframe& keyframe) const;

  const SlamConfig config_;
  FeatureExtractor extractor_;
  std::map<MapPointId, PointTrack> tracks_;
  std::deque<MapKeyframe> kept_keyframes_;  // newest last
  uint64_t keyframe_count_ = 0;
  uint64_t point_count_ = 0;  // ever made
};

}  // namespace romap
