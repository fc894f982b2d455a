#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::slam {

// p_to = scale * rotation * p_from + translation, without frame types.
struct PointAlignment {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};
std::optional<PointAlignment> AlignPointSets(std::span<const Eigen::Vector3d> p_from,
                                             std::span<const Eigen::Vector3d> p_to, bool fix_scale);

// Least-squares similarity p_to = S * p_from (Umeyama 1991) of points that correspond by index. `fix_scale`: scale is
// 1. nullopt: fewer than three points, different counts, or collinear points.
template <class To, class From>
std::optional<Sim3<To, From>> AlignPoints(std::span<const Eigen::Vector3d> p_from,
                                          std::span<const Eigen::Vector3d> p_to, bool fix_scale) {
  const std::optional<PointAlignment> alignment = AlignPointSets(p_from, p_to, fix_scale);
  if (!alignment) return std::nullopt;
  return Sim3<To, From>(alignment->scale, Eigen::Quaterniond(alignment->rotation), alignment->translation);
}

// A point that two keyframes observe, with its position in the map of each.
struct SimilarityMatch {
  Eigen::Vector3d p_first = Eigen::Vector3d::Zero();   // in the first camera's frame, from its map
  Eigen::Vector3d p_second = Eigen::Vector3d::Zero();  // in the second camera's frame, from its map
  Eigen::Vector2d first_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d second_px = Eigen::Vector2d::Zero();
  double first_sigma_px = 1;
  double second_sigma_px = 1;
};

struct SimilarityOptions {
  bool fix_scale = false;  // SE3
  int max_iterations = 300;
  int min_inliers = 20;
  double chi2_bound = 9.210;  // per reprojection, two degrees of freedom
  uint64_t seed = 1;
};

struct SimilarityEstimate {
  Sim3<Camera, Camera> S_first_second;
  std::vector<uint8_t> inlier;  // per match: reprojects within the bound in both cameras
  int inliers = 0;
};

// Estimates the similarity between the maps of two cameras from matches with outliers: AlignPoints on three matches in
// RANSAC, inliers by reprojection into both cameras, then Levenberg-Marquardt on both reprojection errors of the
// inliers (seven parameters; Huber), repeated until the set of inliers no longer changes. nullopt if there are fewer
// than `min_inliers`.
std::optional<SimilarityEstimate> SolveSimilarity(const CameraModel& camera, std::span<const SimilarityMatch> matches,
                                                  const SimilarityOptions& options);

// Only the refinement, from a known start. The bound selects the inliers.
SimilarityEstimate RefineSimilarity(const CameraModel& camera, const Sim3<Camera, Camera>& start,
                                    std::span<const SimilarityMatch> matches, const SimilarityOptions& options);

}  // namespace romap::slam
