#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/messages.h"
#include "server/slam/keyframe.h"
#include "server/slam/slam_config.h"
#include "server/slam/triangulation.h"

namespace romap {

// A map point with all that is needed to find it again and to place it better.
struct PointTrack {
  MapPoint point;
  Descriptor descriptor{};                                         // of its latest sight
  Eigen::Vector3d latest_bearing_world = Eigen::Vector3d::Zero();  // from where the descriptor was taken
  double size_mu = 0;  // width of one pixel of the feature's own octave at the point: size that does not change
  std::vector<Sight> sights = {};  // a bounded, diverse selection of all sights, oldest first
  uint64_t born_keyframe = 0;      // number of the keyframe that made it
  uint64_t latest_keyframe = 0;    // number of the newest keyframe that saw it
};

// The ray of a feature, with its range where the keyframe's depth image gave one.
Sight SightOf(const MapKeyframe& keyframe, int feature, const SlamConfig& config);

// Where a point was found in a keyframe.
struct Sighting {
  int feature = 0;
  int distance = 0;  // Hamming, bits
};

// The feature of `keyframe`, not tied to a point yet, that shows `track`: near its projection, of fitting size and
// descriptor. nullopt: out of sight, seen from too different a direction, not found, or ambiguous.
std::optional<Sighting> FindInKeyframe(const PointTrack& track, const MapKeyframe& keyframe, const SlamConfig& config);

// A track with one sight, at `p_world`.
PointTrack StartTrack(MapPointId id, const MapKeyframe& keyframe, int feature, const Eigen::Vector3d& p_world,
                      const SlamConfig& config);

// Adds the sight of a feature if a position exists that agrees with it and with the earlier ones, and moves the point
// there. Returns false and changes nothing otherwise.
bool AddSight(const MapKeyframe& keyframe, int feature, const SlamConfig& config, PointTrack& track);

}  // namespace romap
