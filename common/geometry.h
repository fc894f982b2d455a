#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace romap {

// Tags of the frames. World: right-handed, map units, z up unless the session's `up_world` differs. Camera: x right,
// y down, z forward (OpenCV). Object: origin at the center of the cuboid, axes along its edges, z along up.
struct World {};
struct Camera {};
struct Object {};

// Rigid transform that maps points of frame `From` to frame `To`: p_to = T_to_from * p_from. The tags make a wrong
// composition a compile error: SE3<A, B> * SE3<B, C> = SE3<A, C>.
template <class To, class From>
class SE3 {
 public:
  SE3() = default;
  SE3(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation)
      : rotation_(rotation.normalized()), translation_(translation) {}
  SE3(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : SE3(Eigen::Quaterniond(rotation), translation) {}

  const Eigen::Quaterniond& rotation() const { return rotation_; }
  const Eigen::Vector3d& translation() const { return translation_; }
  Eigen::Matrix3d RotationMatrix() const { return rotation_.toRotationMatrix(); }

  Eigen::Matrix4d Matrix() const {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() = RotationMatrix();
    matrix.topRightCorner<3, 1>() = translation_;
    return matrix;
  }

  SE3<From, To> Inverse() const {
    const Eigen::Quaterniond inverse = rotation_.conjugate();
    return {inverse, -(inverse * translation_)};
  }

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_from) const { return rotation_ * p_from + translation_; }

  template <class Other>
  SE3<To, Other> operator*(const SE3<From, Other>& other) const {
    return {rotation_ * other.rotation(), rotation_ * other.translation() + translation_};
  }

  bool IsFinite() const { return rotation_.coeffs().allFinite() && translation_.allFinite(); }

 private:
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation_ = Eigen::Vector3d::Zero();
};

// Similarity: p_to = scale * rotation * p_from + translation. Composes like SE3. Corrections of a monocular map are
// similarities, because its scale is as uncertain as its pose.
template <class To, class From>
class Sim3 {
 public:
  Sim3() = default;
  Sim3(double scale, const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation)
      : scale_(scale), rotation_(rotation.normalized()), translation_(translation) {}
  explicit Sim3(const SE3<To, From>& rigid) : Sim3(1.0, rigid.rotation(), rigid.translation()) {}

  double scale() const { return scale_; }  // > 0
  const Eigen::Quaterniond& rotation() const { return rotation_; }
  const Eigen::Vector3d& translation() const { return translation_; }
  // The rigid transform with the same rotation and translation.
  SE3<To, From> Rigid() const { return {rotation_, translation_}; }

  Sim3<From, To> Inverse() const {
    const Eigen::Quaterniond inverse = rotation_.conjugate();
    return {1 / scale_, inverse, -(inverse * translation_) / scale_};
  }

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_from) const {
    return scale_ * (rotation_ * p_from) + translation_;
  }

  template <class Other>
  Sim3<To, Other> operator*(const Sim3<From, Other>& other) const {
    return {scale_ * other.scale(), rotation_ * other.rotation(),
            scale_ * (rotation_ * other.translation()) + translation_};
  }

  // The pose of a rigid frame (camera, object) after its space was moved by this similarity: origin and axes move with
  // the space; the frame's own unit of length stays the same.
  template <class Other>
  SE3<To, Other> Moved(const SE3<From, Other>& frame) const {
    return {rotation_ * frame.rotation(), *this * frame.translation()};
  }

  bool IsFinite() const {
    return std::isfinite(scale_) && scale_ > 0 && rotation_.coeffs().allFinite() && translation_.allFinite();
  }

 private:
  double scale_ = 1;
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation_ = Eigen::Vector3d::Zero();
};

// Shortest rotation from the direction `from` to the direction `to`, which may have any length > 0.
Eigen::Quaterniond ShortestRotation(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Shortest rotation from world +z to `up_world` (unit length): the orientation of a cuboid with yaw 0.
Eigen::Quaterniond RotationFromZTo(const Eigen::Vector3d& up_world);

}  // namespace romap
