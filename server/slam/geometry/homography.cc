#include "server/slam/geometry/homography.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

namespace romap::slam {
namespace {

constexpr int kHomographyRefineRounds = 5;
constexpr int kRotationRounds = 5;
// Translations below this share of the distance to the plane are rounding errors.
constexpr double kNoTranslation = 1e-9;

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs.z() = svd.matrixU().determinant() * svd.matrixV().determinant();
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

std::vector<RayMatch> InliersOf(const CameraModel& camera, const Eigen::Matrix3d& homography,
                                std::span<const RayMatch> matches) {
  const Eigen::Matrix3d inverse = homography.inverse();
  std::vector<RayMatch> inliers;
  for (const RayMatch& match : matches) {
    if (TransferChi2(camera, homography, inverse, match) < kTransferChi2Bound) inliers.push_back(match);
  }
  return inliers;
}

// Squared pixel distance between the projections of two rays; infinite if `mapped` points backward.
double Distance2_px(const CameraModel& camera, const Eigen::Vector3d& mapped, const Eigen::Vector3d& observed) {
  if (!(mapped.z() > 0)) return std::numeric_limits<double>::infinity();
  return (camera.Project(mapped) - camera.Project(observed)).squaredNorm();
}

}  // namespace

std::optional<Eigen::Matrix3d> FitHomography(std::span<const RayMatch> matches) {
  if (matches.size() < 4) return std::nullopt;
  using Row = Eigen::Matrix<double, 9, 1>;
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (const RayMatch& match : matches) {
    Row row = Row::Zero();
    row.segment<3>(0) = match.first;
    row.segment<3>(6) = -match.second.x() * match.first;
    normal.noalias() += row * row.transpose();
    row.segment<3>(0).setZero();
    row.segment<3>(3) = match.first;
    row.segment<3>(6) = -match.second.y() * match.first;
    normal.noalias() += row * row.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
  const Row smallest = solver.eigenvectors().col(0);
  Eigen::Matrix3d homography = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(smallest.data());
  const double determinant = homography.determinant();
  if (!(std::abs(determinant) > 1e-12)) return std::nullopt;
  return homography / std::cbrt(determinant);  // determinant 1, so that points stay in front of the camera
}

double TransferChi2(const CameraModel& camera, const Eigen::Matrix3d& homography, const Eigen::Matrix3d& inverse,
                    const RayMatch& match) {
  const double forward_px2 = Distance2_px(camera, homography * match.first, match.second);
  const double backward_px2 = Distance2_px(camera, inverse * match.second, match.first);
  return std::max(forward_px2, backward_px2) / (match.sigma_px * match.sigma_px);
}

double TransferSupport(const CameraModel& camera, const Eigen::Matrix3d& homography,
                       std::span<const RayMatch> matches) {
  const Eigen::Matrix3d inverse = homography.inverse();
  double support = 0;
  for (const RayMatch& match : matches) {
    support += std::max(0.0, 1 - TransferChi2(camera, homography, inverse, match) / kTransferChi2Bound);
  }
  return support;
}

Eigen::Matrix3d RefineHomography(const CameraModel& camera, const Eigen::Matrix3d& start,
                                 std::span<const RayMatch> matches) {
  Eigen::Matrix3d best = start;
  double best_support = TransferSupport(camera, best, matches);
  for (int round = 0; round < kHomographyRefineRounds; ++round) {
    const std::optional<Eigen::Matrix3d> refitted = FitHomography(InliersOf(camera, best, matches));
    if (!refitted) break;
    const double support = TransferSupport(camera, *refitted, matches);
    if (!(support > best_support)) break;
    best = *refitted;
    best_support = support;
  }
  return best;
}

std::vector<Motion> MotionsFromHomography(const Eigen::Matrix3d& homography) {
  cv::Matx33d matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix(row, column) = homography(row, column);
  }
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  std::vector<Motion> motions;
  try {
    cv::decomposeHomographyMat(matrix, cv::Matx33d::eye(), rotations, translations, cv::noArray());
  } catch (const cv::Exception&) {
    return motions;  // no motion produces this homography
  }
  for (size_t i = 0; i < rotations.size(); ++i) {
    // OpenCV's matrices are row-major.
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(rotations[i].ptr<double>());
    const Eigen::Map<const Eigen::Vector3d> translation(translations[i].ptr<double>());
    if (!rotation.allFinite() || !(translation.norm() > kNoTranslation)) continue;
    motions.push_back({rotation, translation.normalized()});
  }
  return motions;
}

Eigen::Matrix3d FitRotation(const CameraModel& camera, const Eigen::Matrix3d& homography,
                            std::span<const RayMatch> matches) {
  Eigen::Matrix3d rotation = NearestRotation(homography);
  double support = TransferSupport(camera, rotation, matches);
  for (int round = 0; round < kRotationRounds; ++round) {
    // Kabsch 1976 on unit rays.
    Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
    for (const RayMatch& match : InliersOf(camera, rotation, matches)) {
      correlation += match.second.normalized() * match.first.normalized().transpose();
    }
    const Eigen::Matrix3d candidate = NearestRotation(correlation);
    const double candidate_support = TransferSupport(camera, candidate, matches);
    if (!(candidate_support > support)) break;
    rotation = candidate;
    support = candidate_support;
  }
  return rotation;
}

}  // namespace romap::slam
