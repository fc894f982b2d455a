#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "server/objects/correction.h"
#include "server/objects/isolation_forest.h"
#include "server/objects/objects_config.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// What an object is made of according to its masks and points: its silhouettes, the hull they carve, and the box.
class ObjectShape {
 public:
  struct Surroundings {
    Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
    std::span<const Eigen::Vector3d> points;                    // map points that belong to the object, world
    std::span<const Eigen::Vector3d> background;                // map points that belong to no object, world
    const std::map<LandmarkKey, Cuboid>* neighbours = nullptr;  // the other landmarks that have a cuboid
  };
  struct Fit {
    Cuboid cuboid;
    Cuboid reach;                             // see CuboidFit
    std::vector<bool> point_is_inlier;        // as long as Surroundings::points
    std::vector<Eigen::Vector3d> body_world;  // points spread over the object's volume, for association
    double parallax_rad = 0;                  // between the directions it was seen from
  };

  explicit ObjectShape(const ObjectsConfig& config) : config_(config) {}

  // Redundant silhouettes (direction close to another one's) are not kept, so that the cost of a fit stays bounded;
  // then the answer is false. One that is kept costs next to nothing before the next Update().
  bool AddSilhouette(Silhouette silhouette);
  bool IsRedundant(const Silhouette& silhouette) const;
  const std::vector<Silhouette>& silhouettes() const { return silhouettes_; }
  // Whether straight edges on this mask (not redundant) would tell something new: not when edges were looked for from
  // about the same direction, nor once the yaw is sure.
  bool WantsSegments(const Silhouette& silhouette) const;
  // Silhouettes on which edges were looked for.
  size_t SegmentViews() const;
  // Silhouettes that came or were corrected since the last Update().
  int news() const { return news_; }

  // The map was corrected: `S_new_old` happened to the space the object stands in, and its keyframes have new poses.
  // `cuboid`: the object's, moved already. True when some masks now say something else about the object.
  bool Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes,
               const std::optional<Cuboid>& cuboid);

  // The box as of now; nullopt while masks and points do not say where the object is.
  std::optional<Fit> Update(const Surroundings& surroundings, const std::optional<Cuboid>& previous);

 private:
  struct Extent {
    Eigen::Vector3d center_world;
    double size_mu = 0;  // largest diagonal of a mask's box at the object's distance
  };

  std::optional<Extent> EstimateExtent(const Surroundings& surroundings) const;
  void MakeRoom();
  void Unvote(size_t i);
  void VoteForNews();
  void Carve(const HullRegion& region, const Surroundings& surroundings);
  void StraightenRegion(const Surroundings& surroundings);
  void RefocusRegion(const Extent& extent, const Surroundings& surroundings);
  HullVotes StrictVotes() const;
  HullVotes LenientVotes() const;
  std::vector<bool> JudgePoints(std::span<const Eigen::Vector3d> points_world);
  std::vector<double> Loneliness(const std::vector<Eigen::Vector3d>& points_grid);
  std::vector<Eigen::Vector3d> SampleBody(const Cuboid& cuboid, std::span<const Eigen::Vector3d> cells_grid,
                                          std::span<const Eigen::Vector3d> points_world,
                                          const std::vector<bool>& is_inlier) const;

  ObjectsConfig config_;
  std::vector<Silhouette> silhouettes_;
  std::vector<bool> has_voted_;  // per silhouette: `hull_` knows it
  int news_ = 0;
  double edge_yaw_confidence_ = 0;
  SilhouetteHull hull_;
  size_t silhouettes_when_carved_ = 0;
  // Grown on the object's points, in terms of the grid's half width, so that it need not move with the map.
  std::optional<IsolationForest> forest_;
  size_t points_when_grown_ = 0;
};

}  // namespace romap::objects
