#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "server/objects/correction.h"
#include "server/objects/cuboid_fitter.h"
#include "server/objects/isolation_forest.h"
#include "server/objects/objects_config.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// The shape of one object: its silhouettes, the visual hull they carve, and the cuboid fitted to both and to the map
// points.
class ObjectShape {
 public:
  struct Surroundings {
    Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
    std::span<const Eigen::Vector3d> points;                   // map points of the object, world
    std::span<const Eigen::Vector3d> background;               // map points of no object, world
    const std::map<LandmarkKey, Cuboid>* neighbors = nullptr;  // the other confirmed objects; never null in Update()
  };
  struct Fit {
    Cuboid cuboid;
    Cuboid training_box;                      // see CuboidFit
    std::vector<bool> point_is_inlier;        // as long as Surroundings::points
    std::vector<Eigen::Vector3d> body_world;  // points spread over the object's volume, for association
    double parallax_rad = 0;                  // largest angle between two view directions
  };

  explicit ObjectShape(const ObjectsConfig& config) : config_(config) {}

  // Returns false for a redundant silhouette (direction close to another one's), which is not kept: this bounds the
  // time of a fit. Carving is deferred to the next Update().
  bool AddSilhouette(Silhouette silhouette);
  bool IsRedundant(const Silhouette& silhouette) const;
  const std::vector<Silhouette>& silhouettes() const { return silhouettes_; }
  // Whether to detect straight edges on this mask, which must not be redundant. False if a silhouette from about the
  // same direction has edges, or once the yaw is certain.
  bool NeedsSegments(const Silhouette& silhouette) const;
  // Number of silhouettes on which edges were detected.
  size_t SegmentViews() const;
  // Number of silhouettes that were added or corrected since the last Update().
  int changed_silhouettes() const { return changed_silhouettes_; }

  // Applies a map correction: the space around the object moved by `S_new_old`, and its keyframes have new poses.
  // `cuboid`: of the object, already corrected. Returns whether the pose of a silhouette relative to the object changed
  // enough for a new fit.
  bool Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes,
               const std::optional<Cuboid>& cuboid);

  // Fits the cuboid. nullopt while masks and points do not determine the object's position.
  std::optional<Fit> Update(const Surroundings& surroundings, const std::optional<Cuboid>& previous);

 private:
  struct Extent {
    Eigen::Vector3d center_world;
    double size_mu = 0;  // largest diagonal of a mask's box at the object's distance
  };

  std::optional<Extent> EstimateExtent(const Surroundings& surroundings) const;
  void DropMostRedundant();
  void RemoveVote(size_t i);
  void AddMissingVotes();
  void Carve(const HullRegion& region, const Surroundings& surroundings);
  void MakeRegionUpright(const Surroundings& surroundings);
  void FitRegionToHull(const Extent& extent, const Surroundings& surroundings);
  std::vector<bool> FindInliers(std::span<const Eigen::Vector3d> points_world);
  std::vector<double> AnomalyScores(const std::vector<Eigen::Vector3d>& points_grid);
  CuboidEvidence CollectEvidence(const Extent& extent, const Surroundings& surroundings,
                                 std::vector<Eigen::Vector3d> hull_cells, const std::vector<bool>& point_is_inlier);
  std::vector<Eigen::Vector3d> SampleBody(const Cuboid& cuboid, std::span<const Eigen::Vector3d> cells_grid,
                                          std::span<const Eigen::Vector3d> points_world,
                                          const std::vector<bool>& is_inlier) const;

  ObjectsConfig config_;
  std::vector<Silhouette> silhouettes_;
  std::vector<bool> has_voted_;  // per silhouette: `hull_` contains its vote
  int changed_silhouettes_ = 0;
  double edge_yaw_confidence_ = 0;
  SilhouetteHull hull_;
  size_t silhouettes_when_carved_ = 0;
  // The forest is grown on the object's points in units of the grid's half width, so that it stays valid when the map
  // moves.
  std::optional<IsolationForest> forest_;
  size_t points_when_grown_ = 0;
};

}  // namespace romap::objects
