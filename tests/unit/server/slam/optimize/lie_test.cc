#include "server/slam/optimize/lie.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace romap::slam::lie_test {

// Increments from tiny to large: rotation up to 3 rad, scale from 1/20 to 20.
std::vector<Sim3Vector> Samples() {
  std::vector<Sim3Vector> samples;
  const Sim3Vector direction = (Sim3Vector() << 0.5, -0.7, 0.51, 3, -2, 1, 0.9).finished();
  for (const double size : {0.0, 1e-12, 1e-8, 1e-5, 1e-3, 0.1, 1.0, 2.9}) {
    samples.push_back(size * direction);
    Sim3Vector without_scale = size * direction;
    without_scale[6] = 0;
    samples.push_back(without_scale);
    Sim3Vector shrinking = size * direction;
    shrinking.head<3>().setZero();
    shrinking[6] *= -1;
    samples.push_back(shrinking);
  }
  return samples;
}

// The exponential of the 4x4 generator by definition: a long series with scaling and squaring.
Eigen::Matrix4d ExpByDefinition(const Sim3Vector& v) {
  Eigen::Matrix4d generator = Eigen::Matrix4d::Zero();
  generator.topLeftCorner<3, 3>() = Hat(v.head<3>()) + v[6] * Eigen::Matrix3d::Identity();
  generator.topRightCorner<3, 1>() = v.segment<3>(3);
  generator /= 1024;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity();
  Eigen::Matrix4d term = sum;
  for (int n = 1; n < 20; ++n) sum += (term = (term * generator / n).eval());
  for (int i = 0; i < 10; ++i) sum = (sum * sum).eval();
  return sum;
}

Eigen::Matrix4d MatrixOf(const Sim3<Camera, Camera>& S) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = S.scale() * S.rotation().toRotationMatrix();
  matrix.topRightCorner<3, 1>() = S.translation();
  return matrix;
}

TEST(Lie, ExpSim3AgreesWithTheMatrixExponential) {
  for (const Sim3Vector& v : Samples()) {
    const Eigen::Matrix4d expected = ExpByDefinition(v);
    EXPECT_LT((MatrixOf(ExpSim3<Camera>(v)) - expected).cwiseAbs().maxCoeff(), 1e-11 * expected.cwiseAbs().maxCoeff())
        << v.transpose();
  }
}

TEST(Lie, LogIsTheInverseOfExp) {
  for (const Sim3Vector& v : Samples()) {
    EXPECT_LT((LogSim3(ExpSim3<Camera>(v)) - v).norm(), 1e-11 * (1e-3 + v.norm())) << v.transpose();
    const Eigen::Vector3d w = v.head<3>();
    EXPECT_LT((LogRotation(ExpRotation(w)) - w).norm(), 1e-12 * (1e-3 + w.norm())) << w.transpose();
  }
}

TEST(Lie, LogOfAHalfTurnHasLengthPi) {
  const Eigen::Quaterniond half_turn(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d(1, 2, -2) / 3));
  EXPECT_NEAR(LogRotation(half_turn).norm(), std::numbers::pi, 1e-12);
}

TEST(Lie, SmallIncrementsKeepFullPrecision) {
  const Sim3Vector v = 1e-12 * (Sim3Vector() << 1, 2, 3, 4, 5, 6, 7).finished();
  const Sim3<Camera, Camera> S = ExpSim3<Camera>(v);
  EXPECT_LT((S.rotation().vec() - 0.5 * v.head<3>()).norm(), 1e-24);
  EXPECT_LT((S.translation() - v.segment<3>(3)).norm(), 1e-22);
}

TEST(Lie, RightJacobiansMatchFiniteDifferences) {
  constexpr double kStep = 1e-6;
  for (const Sim3Vector& v : Samples()) {
    const Sim3<Camera, Camera> inverse = ExpSim3<Camera>(v).Inverse();
    const Eigen::Quaterniond inverse_rotation = ExpRotation(v.head<3>()).conjugate();
    Sim3Matrix numeric;
    Eigen::Matrix3d numeric_rotation;
    for (int i = 0; i < 7; ++i) {
      const Sim3Vector step = kStep * Sim3Vector::Unit(i);
      numeric.col(i) =
          (LogSim3(inverse * ExpSim3<Camera>(v + step)) - LogSim3(inverse * ExpSim3<Camera>(v - step))) / (2 * kStep);
      if (i >= 3) continue;
      numeric_rotation.col(i) = (LogRotation(inverse_rotation * ExpRotation((v + step).head<3>())) -
                                 LogRotation(inverse_rotation * ExpRotation((v - step).head<3>()))) /
                                (2 * kStep);
    }
    const Sim3Matrix analytic = RightJacobianOfSim3(v);
    EXPECT_LT((analytic - numeric).cwiseAbs().maxCoeff(), 1e-7 * numeric.cwiseAbs().maxCoeff()) << v.transpose();
    EXPECT_LT((RightJacobianOfRotation(v.head<3>()) - numeric_rotation).cwiseAbs().maxCoeff(), 1e-8) << v.transpose();
  }
}

TEST(Lie, AdjointConvertsRightToLeftIncrements) {
  const Sim3Vector v = (Sim3Vector() << 0.1, 0.2, -0.3, 0.4, -0.5, 0.6, 0.2).finished();
  const Sim3<World, Camera> S(1.7, ExpRotation({0.3, 1.1, -0.8}), {2, -1, 3});
  const Eigen::Vector3d p_camera(0.3, -0.4, 2);
  const Eigen::Vector3d by_right = S * (ExpSim3<Camera>(v) * p_camera);
  const Eigen::Vector3d by_left = ExpSim3<World>(AdjointOfSim3(S) * v) * (S * p_camera);
  EXPECT_LT((by_right - by_left).norm(), 1e-12);
}

}  // namespace romap::slam::lie_test
