#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "common/stage_messages.h"

namespace romap::objects {

// Key of a landmark inside the object mapper.
using LandmarkKey = uint32_t;
inline constexpr LandmarkKey kBackgroundKey = 0;
inline constexpr LandmarkKey kNoLandmark = ~LandmarkKey{0};
inline constexpr LandmarkKey kOutlineKey = kNoLandmark - 1;

// Assigns map points to landmarks. Every observation of a point in a keyframe is a vote: masks are wrong near their
// borders and labels are sometimes swapped, but rarely for the same point in most keyframes. Observations just outside
// of a mask count for the outline: a feature there may lie on the object or on the background.
class PointRegistry {
 public:
  // Applies the new positions and removals of a keyframe. Points without a finite position are removed.
  void UpdatePositions(const KeyframeView& view);
  // Sets new positions after a correction. Unknown points and positions that are not finite are ignored.
  void MovePoints(const std::vector<MapPoint>& points);
  // Records that the point was observed under the mask of landmark `key`, under no mask and not near one
  // (kBackgroundKey), or near a mask (kOutlineKey).
  void Vote(MapPointId point, LandmarkKey key);
  // Moves all votes for `from` to `into`.
  void Merge(LandmarkKey from, LandmarkKey into);

  // Adds the points of another registry, which has none of these.
  void Append(PointRegistry other);

  bool IsEmpty() const { return points_.empty(); }
  // Position of a point; nullptr if unknown.
  const Eigen::Vector3d* Find(MapPointId point) const;

  struct Member {
    MapPointId id;
    Eigen::Vector3d position_world;
  };
  // All points with a clear owner, a landmark, the background or the outline, ordered by id.
  std::map<LandmarkKey, std::vector<Member>> GroupByOwner() const;

 private:
  struct Entry {
    MapPointId id;
    Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
    std::vector<std::pair<LandmarkKey, int>> votes;
    std::optional<LandmarkKey> owner;  // see UpdateOwner()
  };

  // Index into `points_`; points_.size() for an unknown point.
  size_t IndexOf(MapPointId point) const;
  static void UpdateOwner(Entry* entry);

  std::vector<Entry> points_;  // ordered by id; a vector, because every keyframe iterates over all of them
};

}  // namespace romap::objects
