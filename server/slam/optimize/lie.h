#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "common/geometry.h"

namespace romap::slam {

// Exponentials, logarithms and Jacobians of rotations and similarities (Sola et al., "A micro Lie theory for state
// estimation in robotics", 2018; Strasdat, "Local accuracy and global consistency for efficient visual SLAM", 2012, for
// sim(3)). Increments are right-multiplied: X * Exp(d).

// Vector of sim(3): rotation vector (rad), translation (units of the frame), logarithm of the scale.
using Sim3Vector = Eigen::Matrix<double, 7, 1>;
using Sim3Matrix = Eigen::Matrix<double, 7, 7>;

// phi_1(A) = sum of A^n / (n + 1)!, the integral of exp(s A) over s in [0, 1]. The translation part of every
// exponential and every Jacobian here uses this function. It is entire, so zero angle and unit scale need no special
// cases. Accurate to rounding for eigenvalues up to about ten. Requires a finite A.
template <int N>
Eigen::Matrix<double, N, N> IntegratedExponential(const Eigen::Matrix<double, N, N>& a) {
  constexpr int kMaxTerms = 200;
  Eigen::Matrix<double, N, N> term = Eigen::Matrix<double, N, N>::Identity();
  Eigen::Matrix<double, N, N> sum = term;
  for (int n = 1; n < kMaxTerms; ++n) {
    term = (term * a / (n + 1)).eval();
    sum += term;
    if (term.cwiseAbs().maxCoeff() <= 1e-17 * sum.cwiseAbs().maxCoeff()) break;
  }
  return sum;
}

// The matrix of the cross product: Hat(a) * b = a x b.
Eigen::Matrix3d Hat(const Eigen::Vector3d& a);

// Rotation by |w| (rad) about w, and its inverse. The length of the logarithm is at most pi.
Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& rotation_rad);
Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation);

// J with Exp(w + d) = Exp(w) * Exp(J d) for small d. Invertible for |w| < 2 pi.
Eigen::Matrix3d RightJacobianOfRotation(const Eigen::Vector3d& rotation_rad);

// The same for similarities.
Sim3Matrix RightJacobianOfSim3(const Sim3Vector& v);

template <class Frame>
Sim3<Frame, Frame> ExpSim3(const Sim3Vector& v) {
  const Eigen::Matrix3d generator = Hat(v.head<3>()) + v[6] * Eigen::Matrix3d::Identity();
  return {std::exp(v[6]), ExpRotation(v.head<3>()), IntegratedExponential<3>(generator) * v.segment<3>(3)};
}

// Inverse of ExpSim3 for rotations up to pi. Requires a finite S with scale > 0.
template <class Frame>
Sim3Vector LogSim3(const Sim3<Frame, Frame>& S) {
  Sim3Vector v;
  v.head<3>() = LogRotation(S.rotation());
  v[6] = std::log(S.scale());
  const Eigen::Matrix3d generator = Hat(v.head<3>()) + v[6] * Eigen::Matrix3d::Identity();
  v.segment<3>(3) = IntegratedExponential<3>(generator).inverse() * S.translation();
  return v;
}

// S * Exp(v) * S^-1 = Exp(Adjoint(S) * v).
template <class To, class From>
Sim3Matrix AdjointOfSim3(const Sim3<To, From>& S) {
  const Eigen::Matrix3d R = S.rotation().toRotationMatrix();
  Sim3Matrix adjoint = Sim3Matrix::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.block<3, 3>(3, 0) = Hat(S.translation()) * R;
  adjoint.block<3, 3>(3, 3) = S.scale() * R;
  adjoint.block<3, 1>(3, 6) = -S.translation();
  adjoint(6, 6) = 1;
  return adjoint;
}

}  // namespace romap::slam
