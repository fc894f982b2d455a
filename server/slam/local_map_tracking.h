#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/pose_uncertainty.h"
#include "server/slam/frame_features.h"
#include "server/slam/geometry/pose_refiner.h"
#include "server/slam/local_map.h"
#include "server/slam/patch_search.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// A camera pose with the points of the local map that were matched to the frame.
struct PoseFromPoints {
  SE3<World, Camera> T_world_camera;
  std::vector<int> point_of_feature;      // per feature: index into LocalMap::points, -1 = none or outlier
  std::vector<int> points_by_patch = {};  // indices of the points that were found by their patches, without outliers
  int inliers = 0;
  int matches = 0;  // inliers and outliers
  // By the errors of the frame's features alone, as if the points were exact.
  PoseUncertainty uncertainty = {};
};

// Estimates the pose of one frame from the points of a local map. All methods return nullopt if they match too few
// points. Holds references: `map` and `frame` must outlive it.
class LocalMapTracking {
 public:
  LocalMapTracking(const LocalMap& map, const FrameFeatures& frame, const SlamConfig& config)
      : map_(map), frame_(frame), config_(config) {}

  // Searches the points `ids`, or all points if too few of those are in the map, within `radius_px` around their
  // projections at the pose `start`.
  std::optional<PoseFromPoints> TrackByProjection(const std::vector<MapPointId>& ids, const SE3<World, Camera>& start,
                                                  double radius_px) const;
  // As TrackByProjection() with all points, for few or unreliable matches: AddPatches() must confirm the pose.
  std::optional<PoseFromPoints> TrackLoosely(const SE3<World, Camera>& start, double radius_px) const;
  // Matches the points `ids`, or all points if too few of those are in the map, by their descriptors alone, then solves
  // P3P.
  std::optional<PoseFromPoints> TrackByDescriptors(const std::vector<MapPointId>& ids) const;
  // Searches all points in a wide area around their projections at the pose of a recently relocalized frame.
  std::optional<PoseFromPoints> TrackNear(const SE3<World, Camera>& start) const;
  // Refines `first` with all points of the local map, searched close to their projections.
  std::optional<PoseFromPoints> TrackAllPoints(const PoseFromPoints& first, int min_inliers) const;

  // Adds points that no feature matches, found by their patches close to their projections, and refines the pose.
  // `image`: of the frame, as recorded.
  std::optional<PoseFromPoints> AddPatches(const PoseFromPoints& pose, const HalvedImages& image) const;

  // Refines the pose of a frame whose features have moved since, by the same matches. `image_bgr`: as for AddPatches().
  std::optional<PoseFromPoints> RefineMatches(const PoseFromPoints& pose, const cv::Mat& image_bgr) const;

  // Median depth of the matched points [mu]; 0 if there are none.
  double MedianDepth_mu(const PoseFromPoints& pose) const;
  // z depth per feature [mu]; 0 if it has no point.
  std::vector<double> DepthsOfFeatures(const PoseFromPoints& pose) const;

  // The observation of map_.points[point] by a feature of the frame.
  PoseObservation Observe(int feature, int point) const;

 private:
  // Indices into map_.points: of the points `ids`, or of all points if too few of those are in the map.
  std::vector<int> IndicesOrAll(const std::vector<MapPointId>& ids) const;
  // A point that was found by its patch.
  struct PatchMatch {
    int point = 0;
    FoundPatch found;
  };
  PoseObservation Observe(const PatchMatch& match) const;
  std::optional<PoseFromPoints> TrackAround(const std::vector<int>& indices, const SE3<World, Camera>& start,
                                            double radius_px, int min_inliers) const;
  std::optional<PoseFromPoints> Refine(const SE3<World, Camera>& start, std::vector<int> point_of_feature,
                                       int min_inliers, std::span<const PatchMatch> patches = {}) const;

  const LocalMap& map_;
  const FrameFeatures& frame_;
  const SlamConfig& config_;
};

}  // namespace romap::slam
