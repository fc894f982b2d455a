#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "common/stage_messages.h"

namespace romap::objects {

// Key of a landmark inside the object mapper. 0 is the background.
using LandmarkKey = uint32_t;
inline constexpr LandmarkKey kBackgroundKey = 0;

// The map points by the landmark they belong to. Every sight of a point in a keyframe is a vote: masks err at their
// rims and labels get mixed up, but not for the same point in most keyframes.
class PointRegistry {
 public:
  // Takes over positions and removals of a keyframe. Points without a finite position are forgotten.
  void UpdatePositions(const KeyframeView& view);
  // New positions of points after a correction. Points that are not known (any more) are passed over.
  void MovePoints(const std::vector<MapPoint>& points);
  // The point was seen under the mask of landmark `key`, or under none (kBackgroundKey).
  void Vote(MapPointId point, LandmarkKey key);
  // Votes for `from` count for `into` from now on.
  void Merge(LandmarkKey from, LandmarkKey into);

  const Eigen::Vector3d* Find(MapPointId point) const;

  struct Member {
    MapPointId id;
    Eigen::Vector3d position_world;
  };
  // All points that clearly belong to one landmark or to the background, in the order of their ids.
  std::map<LandmarkKey, std::vector<Member>> GroupByOwner() const;

 private:
  struct Entry {
    MapPointId id;
    Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
    std::vector<std::pair<LandmarkKey, int>> votes;
    std::optional<LandmarkKey> owner;  // to whom it clearly belongs
  };

  // Place in `points_`; its size for a point that is not known.
  size_t IndexOf(MapPointId point) const;
  static void JudgeOwner(Entry* entry);

  std::vector<Entry> points_;  // by id: all of them are looked through at every keyframe
};

}  // namespace romap::objects
