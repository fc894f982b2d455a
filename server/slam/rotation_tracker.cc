#include "server/slam/rotation_tracker.h"

#include <Eigen/SVD>
#include <random>
#include <utility>

#include "common/angles.h"
#include "server/slam/descriptor_matching.h"
#include "server/slam/geometry/random_sample.h"

namespace romap::slam {
namespace {

constexpr double kRotationSearchShare = 0.08;  // of the image's width, around the prediction by the last rotation
constexpr int kMaxRotationDistance = 60;       // Hamming, bits
constexpr double kRotationRatio = 0.85;
constexpr double kErrorSigmas = 3;
constexpr int kMaxRotationSamples = 200;
constexpr size_t kMinRotationInliers = 40;
// With parallax, points at different depths disagree. Moving objects and wrong matches remain below this share.
constexpr double kMinRotationShare = 0.7;
constexpr double kMaxFromReference_rad = 15 * kRadPerDeg;

// The rotation that maps the rays of the frame to those of the reference best (Kabsch 1976).
template <class Pairs, class Indices>
Eigen::Quaterniond BestRotation(const Pairs& pairs, const Indices& indices) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto i : indices) {
    const auto& pair = pairs[static_cast<size_t>(i)];
    covariance += pair.reference * pair.frame.transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()));
}

}  // namespace

void RotationTracker::Start(std::shared_ptr<const FrameFeatures> frame, const Eigen::Quaterniond& R_world_camera) {
  reference_ = std::move(frame);
  R_world_reference_ = R_world_camera;
  R_reference_last_.setIdentity();
}

std::optional<Eigen::Quaterniond> RotationTracker::Track(const std::shared_ptr<const FrameFeatures>& frame) {
  if (!reference_) return std::nullopt;
  const std::vector<RayPair> pairs = MatchReference(*frame);
  if (pairs.size() < kMinRotationInliers) return std::nullopt;
  const auto [R_reference_frame, inliers] = FindRotation(pairs, config_.Seed(frame->frame_id));
  const bool fits = inliers.size() >= kMinRotationInliers &&
                    static_cast<double>(inliers.size()) >= kMinRotationShare * static_cast<double>(pairs.size());
  if (!fits) return std::nullopt;
  R_reference_last_ = R_reference_frame;
  const Eigen::Quaterniond R_world_camera = (R_world_reference_ * R_reference_frame).normalized();
  if (Eigen::AngleAxisd(R_reference_frame).angle() > kMaxFromReference_rad) Start(frame, R_world_camera);
  return R_world_camera;
}

std::vector<RotationTracker::RayPair> RotationTracker::MatchReference(const FrameFeatures& frame) const {
  const double radius_px = kRotationSearchShare * frame.camera.width_px;
  const Eigen::Quaterniond R_last_reference = R_reference_last_.conjugate();
  std::vector<RayPair> pairs;
  std::vector<int> near;
  for (size_t i = 0; i < reference_->size(); ++i) {
    const Feature& feature = reference_->features[i];
    const Eigen::Vector3d ray = R_last_reference * reference_->bearings_camera[i];
    if (!(ray.z() > 0)) continue;
    frame.grid.Near(frame.camera.Project(ray), radius_px, near);
    const NearestFeature nearest = FindNearest(feature, frame.features, near, /*max_octave_difference=*/1);
    if (!nearest.IsDistinct(kMaxRotationDistance, kRotationRatio)) continue;
    const auto k = static_cast<size_t>(nearest.index);
    const double scale = std::max(feature.octave_scale, frame.features[k].octave_scale);
    pairs.push_back({.reference = reference_->bearings_camera[i],
                     .frame = frame.bearings_camera[k],
                     .max_error = kErrorSigmas * config_.pixel_sigma_px * scale / frame.camera.fx_px});
  }
  return pairs;
}

std::pair<Eigen::Quaterniond, std::vector<size_t>> RotationTracker::FindRotation(const std::vector<RayPair>& pairs,
                                                                                 uint64_t seed) const {
  const auto inliers_of = [&](const Eigen::Quaterniond& R) {
    std::vector<size_t> inliers;
    for (size_t i = 0; i < pairs.size(); ++i) {
      if ((R * pairs[i].frame - pairs[i].reference).norm() <= pairs[i].max_error) inliers.push_back(i);
    }
    return inliers;
  };
  std::mt19937_64 random(seed);
  const auto count = static_cast<int>(pairs.size());
  Eigen::Quaterniond best = R_reference_last_;
  std::vector<size_t> inliers = inliers_of(best);
  for (int sample = 0; sample < SamplesNeeded(static_cast<double>(inliers.size()) / count, 2, kMaxRotationSamples);
       ++sample) {
    const Eigen::Quaterniond R = BestRotation(pairs, SampleDistinct<2>(count, random));
    std::vector<size_t> of_sample = inliers_of(R);
    if (of_sample.size() <= inliers.size()) continue;
    best = R;
    inliers = std::move(of_sample);
  }
  for (int round = 0; round < 2 && inliers.size() >= 2; ++round) {
    best = BestRotation(pairs, inliers);
    inliers = inliers_of(best);
  }
  return {best, inliers};
}

}  // namespace romap::slam
