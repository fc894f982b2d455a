#include "server/slam/geometry/motion_search.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "server/slam/geometry/homography.h"
#include "server/slam/geometry/random_sample.h"

namespace romap::slam {
namespace {

constexpr int kSampleSize = 5;
constexpr size_t kMaxMotions = 6;
// Models with at least this share of the best model's support are kept.
constexpr double kMinSupportShare = 0.6;
// Motions from five noisy matches that are closer to each other than this converge to the same motion.
constexpr double kDuplicateRotation_rad = 0.03;
constexpr double kDuplicateDirection_rad = 0.25;

using Sample = std::array<RayMatch, kSampleSize>;

// The essential matrices, at most ten, that agree with five matches.
std::vector<Eigen::Matrix3d> SolveFivePoint(const Sample& sample) {
  std::array<cv::Point2d, kSampleSize> first;
  std::array<cv::Point2d, kSampleSize> second;
  for (int i = 0; i < kSampleSize; ++i) {
    first[i] = {sample[i].first.x(), sample[i].first.y()};
    second[i] = {sample[i].second.x(), sample[i].second.y()};
  }
  std::vector<Eigen::Matrix3d> essentials;
  cv::Mat stacked;
  try {
    // For exactly five matches, OpenCV returns all solutions of its minimal solver, stacked vertically, without RANSAC.
    stacked = cv::findEssentialMat(first, second, cv::Matx33d::eye(), cv::RANSAC);
  } catch (const cv::Exception&) {
    return essentials;  // a degenerate sample
  }
  for (int row = 0; row + 3 <= stacked.rows; row += 3) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> essential(stacked.ptr<double>(row));
    if (essential.allFinite()) essentials.push_back(essential);
  }
  return essentials;
}

struct MotionScore {
  double support = 0;
  int inliers = 0;
};

MotionScore ScoreMotion(const CameraModel& camera, const Eigen::Matrix3d& essential,
                        std::span<const RayMatch> matches) {
  MotionScore score;
  for (const RayMatch& match : matches) {
    const double chi2 = SampsonChi2(camera, essential, match);
    if (!(chi2 < kEpipolarChi2Bound)) continue;
    score.support += 1 - chi2 / kEpipolarChi2Bound;
    ++score.inliers;
  }
  return score;
}

// Returns the one of the four motions of an essential matrix (Hartley and Zisserman, result 9.19) with the most matches
// in front of both cameras.
Motion MotionFromEssential(const CameraModel& camera, const Eigen::Matrix3d& essential,
                           std::span<const RayMatch> matches) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Motion best;
  double best_support = -1;
  for (const Eigen::Matrix3d& middle : {quarter_turn, Eigen::Matrix3d(quarter_turn.transpose())}) {
    Eigen::Matrix3d rotation = svd.matrixU() * middle * svd.matrixV().transpose();
    if (rotation.determinant() < 0) rotation = -rotation;
    for (const double sign : {1.0, -1.0}) {
      const Motion motion{rotation, sign * svd.matrixU().col(2)};
      const double support = Support(camera, motion, matches);
      if (support <= best_support) continue;
      best = motion;
      best_support = support;
    }
  }
  return best;
}

// The best motions so far, without near duplicates.
class Shortlist {
 public:
  // Minimum support of a motion to be added.
  double Threshold() const {
    const double share = entries_.empty() ? 0.0 : kMinSupportShare * entries_.front().support;
    return entries_.size() < kMaxMotions ? share : std::max(share, entries_.back().support);
  }

  void Add(const Motion& motion, double support) {
    for (const Entry& entry : entries_) {
      if (entry.support >= support && AreSimilar(entry.motion, motion, kDuplicateRotation_rad, kDuplicateDirection_rad))
        return;
    }
    std::erase_if(entries_, [&](const Entry& entry) {
      return AreSimilar(entry.motion, motion, kDuplicateRotation_rad, kDuplicateDirection_rad);
    });
    const auto position =
        std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) { return entry.support < support; });
    entries_.insert(position, {motion, support});
    if (entries_.size() > kMaxMotions) entries_.pop_back();
  }

  std::vector<Motion> Motions() const {
    std::vector<Motion> motions;
    for (const Entry& entry : entries_) {
      if (entry.support >= kMinSupportShare * entries_.front().support) motions.push_back(entry.motion);
    }
    return motions;
  }

 private:
  struct Entry {
    Motion motion;
    double support = 0;
  };
  std::vector<Entry> entries_;  // best first
};

}  // namespace

std::optional<Motion> FindMotion(const CameraModel& camera, std::span<const RayMatch> matches, int max_iterations,
                                 uint64_t seed) {
  const MotionSearch search = SearchMotions(camera, matches, max_iterations, seed);
  if (search.motions.empty()) return std::nullopt;
  return RefineMotion(camera, search.motions.front(), matches).motion;
}

bool AreSimilar(const Motion& a, const Motion& b, double rotation_rad, double direction_rad) {
  const double turn_rad = Eigen::AngleAxisd(a.rotation.transpose() * b.rotation).angle();
  return turn_rad < rotation_rad && a.direction.dot(b.direction) > std::cos(direction_rad);
}

MotionSearch SearchMotions(const CameraModel& camera, std::span<const RayMatch> matches, int max_iterations,
                           uint64_t seed) {
  MotionSearch search;
  if (matches.size() < kSampleSize) return search;
  const int count = static_cast<int>(matches.size());
  std::mt19937_64 random(seed);
  Shortlist shortlist;
  int needed = max_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    Sample sample;
    const std::array<int, kSampleSize> indices = SampleDistinct<kSampleSize>(count, random);
    std::transform(indices.begin(), indices.end(), sample.begin(), [&](int index) { return matches[index]; });

    for (const Eigen::Matrix3d& essential : SolveFivePoint(sample)) {
      const MotionScore score = ScoreMotion(camera, essential, matches);
      if (score.support <= shortlist.Threshold()) continue;
      shortlist.Add(MotionFromEssential(camera, essential, matches), score.support);
      if (score.support <= search.essential_support) continue;
      search.essential_support = score.support;
      needed = SamplesNeeded(static_cast<double>(score.inliers) / count, kSampleSize, max_iterations);
    }
    if (const auto homography = FitHomography(std::span(sample).first<4>())) {
      const double support = TransferSupport(camera, *homography, matches);
      if (support > search.homography_support) {
        search.homography_support = support;
        search.homography = homography;
      }
    }
  }
  search.motions = shortlist.Motions();
  if (search.homography) {
    search.homography = RefineHomography(camera, *search.homography, matches);
    search.homography_support = TransferSupport(camera, *search.homography, matches);
  }
  return search;
}

}  // namespace romap::slam
