#include "server/slam/body_rotation.h"

#include <Eigen/SVD>
#include <algorithm>
#include <vector>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr size_t kMinRotationPairs = 6;
constexpr double kMinPairRotation_rad = 2 * kRadPerDeg;
constexpr double kMinBodyRotation_rad =
    10 * kRadPerDeg;                            // of the result: the poses are those of a body, not only noisy
constexpr double kMaxRotationErrorShare = 0.2;  // of the rotation of a pair
constexpr double kMinAgreeingRotations = 0.8;
constexpr double kMinAxisSpread = 0.15;  // of the axes: second singular value over the first
constexpr int kBodyRotationRounds = 3;

bool AgreesWithBody(const Eigen::Quaterniond& R_body_camera, const RotationPair& pair) {
  const double error_rad = (pair.body_rad - R_body_camera * pair.camera_rad).norm();
  return error_rad < kMaxRotationErrorShare * std::max(pair.camera_rad.norm(), pair.body_rad.norm());
}

}  // namespace

std::optional<Eigen::Quaterniond> FindBodyRotation(std::span<const RotationPair> pairs) {
  std::vector<RotationPair> usable;
  for (const RotationPair& pair : pairs) {
    if (pair.camera_rad.norm() > kMinPairRotation_rad) usable.push_back(pair);
  }
  if (usable.size() < kMinRotationPairs) return std::nullopt;
  std::vector<RotationPair> agreeing = usable;
  Eigen::Quaterniond R_body_camera = Eigen::Quaterniond::Identity();
  for (int round = 0; round < kBodyRotationRounds; ++round) {
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (const RotationPair& pair : agreeing) moment += pair.body_rad * pair.camera_rad.transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
    if (!(svd.singularValues()[1] > kMinAxisSpread * kMinAxisSpread * svd.singularValues()[0])) return std::nullopt;
    Eigen::Vector3d signs = Eigen::Vector3d::Ones();
    signs.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    R_body_camera = Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()));
    agreeing.clear();
    for (const RotationPair& pair : usable) {
      if (AgreesWithBody(R_body_camera, pair)) agreeing.push_back(pair);
    }
    if (static_cast<double>(agreeing.size()) < kMinAgreeingRotations * static_cast<double>(usable.size())) {
      return std::nullopt;
    }
  }
  if (R_body_camera.angularDistance(Eigen::Quaterniond::Identity()) < kMinBodyRotation_rad) return std::nullopt;
  return R_body_camera;
}

}  // namespace romap::slam
