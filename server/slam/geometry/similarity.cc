#include "server/slam/geometry/similarity.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <random>

#include "server/slam/geometry/random_sample.h"
#include "server/slam/geometry/similarity_equations.h"

namespace romap::slam {
namespace {

constexpr int kSimilaritySampleSize = 3;
constexpr int kSimilarityRefineRounds = 5;
constexpr int kSimilarityIterations = 8;
// Minimum ratio of the second to the first singular value of the points' correlation. Below it, the points are
// collinear (to a hundredth of their extent), and the rotation about the line is undetermined.
constexpr double kMinSingularValueRatio = 1e-4;

Similarity FromSim3(const Sim3<Camera, Camera>& S) {
  return {S.scale(), S.rotation().toRotationMatrix(), S.translation()};
}
Sim3<Camera, Camera> ToSim3(const Similarity& similarity) {
  return {similarity.scale, Eigen::Quaterniond(similarity.rotation), similarity.translation};
}

bool Agrees(const CameraModel& camera, const Similarity& similarity, const SimilarityMatch& match,
            const SimilarityOptions& options) {
  const SimilarityErrors errors = ErrorsOf(camera, similarity, match);
  return errors.first.squaredNorm() <= options.chi2_bound && errors.second.squaredNorm() <= options.chi2_bound &&
         errors.is_in_front_of_both;
}

int MarkSimilarityInliers(const CameraModel& camera, const Similarity& similarity,
                          std::span<const SimilarityMatch> matches, const SimilarityOptions& options,
                          std::vector<uint8_t>& inlier) {
  int count = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    inlier[i] = Agrees(camera, similarity, matches[i], options);
    count += inlier[i];
  }
  return count;
}

}  // namespace

std::optional<PointAlignment> AlignPointSets(std::span<const Eigen::Vector3d> p_from,
                                             std::span<const Eigen::Vector3d> p_to, bool fix_scale) {
  const size_t count = p_from.size();
  if (count < 3 || p_to.size() != count) return std::nullopt;
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < count; ++i) {
    from_mean += p_from[i] / static_cast<double>(count);
    to_mean += p_to[i] / static_cast<double>(count);
  }
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  double from_spread = 0;
  for (size_t i = 0; i < count; ++i) {
    correlation += (p_to[i] - to_mean) * (p_from[i] - from_mean).transpose();
    from_spread += (p_from[i] - from_mean).squaredNorm();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d spreads = svd.singularValues();
  if (!(spreads[1] > kMinSingularValueRatio * spreads[0])) return std::nullopt;
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs.z() = -1;

  PointAlignment alignment;
  alignment.rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  if (!fix_scale) alignment.scale = spreads.dot(signs) / from_spread;
  if (!(alignment.scale > 0)) return std::nullopt;
  alignment.translation = to_mean - alignment.scale * (alignment.rotation * from_mean);
  return alignment;
}

std::optional<SimilarityEstimate> SolveSimilarity(const CameraModel& camera, std::span<const SimilarityMatch> matches,
                                                  const SimilarityOptions& options) {
  const int count = static_cast<int>(matches.size());
  if (count < std::max(kSimilaritySampleSize, options.min_inliers)) return std::nullopt;
  std::mt19937_64 random(options.seed);
  std::vector<uint8_t> inlier(matches.size());
  std::optional<SimilarityEstimate> best;
  int most_inliers = 0;
  int needed = options.max_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    std::array<Eigen::Vector3d, kSimilaritySampleSize> p_first;
    std::array<Eigen::Vector3d, kSimilaritySampleSize> p_second;
    const std::array<int, kSimilaritySampleSize> indices = SampleDistinct<kSimilaritySampleSize>(count, random);
    for (int i = 0; i < kSimilaritySampleSize; ++i) {
      p_first[i] = matches[indices[i]].p_first;
      p_second[i] = matches[indices[i]].p_second;
    }
    const auto start = AlignPoints<Camera, Camera>(p_second, p_first, options.fix_scale);
    if (!start) continue;
    const int inliers = MarkSimilarityInliers(camera, FromSim3(*start), matches, options, inlier);
    if (inliers <= most_inliers) continue;
    most_inliers = inliers;
    // Refined immediately (Chum et al. 2003), because a similarity from three points with noisy depths misses many
    // inliers.
    SimilarityEstimate refined = RefineSimilarity(camera, *start, matches, options);
    if (best && refined.inliers <= best->inliers) continue;
    best = std::move(refined);
    needed = SamplesNeeded(static_cast<double>(best->inliers) / count, kSimilaritySampleSize, options.max_iterations);
  }
  if (!best || best->inliers < options.min_inliers) return std::nullopt;
  return best;
}

SimilarityEstimate RefineSimilarity(const CameraModel& camera, const Sim3<Camera, Camera>& start,
                                    std::span<const SimilarityMatch> matches, const SimilarityOptions& options) {
  Similarity similarity = FromSim3(start);
  std::vector<uint8_t> active(matches.size());
  std::vector<uint8_t> next_active(matches.size());
  int inliers = MarkSimilarityInliers(camera, similarity, matches, options, active);
  const auto linearize = [&](const Similarity& at) {
    SimilarityEquations equations;
    for (size_t i = 0; i < matches.size(); ++i) {
      if (active[i]) AddSimilarityErrors(camera, at, matches[i], options, equations);
    }
    return equations;
  };
  for (int round = 0; round < kSimilarityRefineRounds && inliers >= kSimilaritySampleSize; ++round) {
    Minimize<7>(kSimilarityIterations, linearize, ApplySimilarityStep, similarity);
    inliers = MarkSimilarityInliers(camera, similarity, matches, options, next_active);
    const bool is_settled = next_active == active;
    active.swap(next_active);
    if (is_settled) break;
  }
  return {ToSim3(similarity), std::move(active), inliers};
}

}  // namespace romap::slam
