#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "common/status.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// Conversions between plain values and wire messages. `where` is the path of the field, for error messages: every
// FromProto returns INVALID_ARGUMENT "<where>...: <what would be right>" for an invalid message.

v1::Vector3 ToProto(const Eigen::Vector3d& vector);
v1::Quaternion ToProto(const Eigen::Quaterniond& quaternion);
v1::Camera ToProto(const CameraModel& camera);

template <class To, class From>
v1::RigidTransform ToProto(const SE3<To, From>& transform) {
  v1::RigidTransform proto;
  *proto.mutable_rotation() = ToProto(transform.rotation());
  *proto.mutable_translation() = ToProto(transform.translation());
  return proto;
}

// All numbers must be finite.
absl::StatusOr<Eigen::Vector3d> VectorFromProto(const v1::Vector3& proto, const std::string& where);
// Must be finite, with a norm within 0.001 of 1; the result is normalized.
absl::StatusOr<Eigen::Quaterniond> QuaternionFromProto(const v1::Quaternion& proto, const std::string& where);
// Must have a size that fits into int, a known lens, and none or all of its distortion coefficients. Everything else is
// checked by ValidateCameraModel.
absl::StatusOr<CameraModel> CameraFromProto(const v1::Camera& proto, const std::string& where);

// The caller specifies the frames: TransformFromProto<World, Camera>(frame.t_world_camera(), "frame.t_world_camera").
template <class To, class From>
absl::StatusOr<SE3<To, From>> TransformFromProto(const v1::RigidTransform& proto, const std::string& where) {
  if (!proto.has_rotation()) return InvalidArgument("{}.rotation: missing", where);
  if (!proto.has_translation()) return InvalidArgument("{}.translation: missing", where);
  ROMAP_ASSIGN_OR_RETURN(const auto rotation, QuaternionFromProto(proto.rotation(), where + ".rotation"));
  ROMAP_ASSIGN_OR_RETURN(const auto translation, VectorFromProto(proto.translation(), where + ".translation"));
  return SE3<To, From>(rotation, translation);
}

absl::Status CheckFinite(double value, const std::string& where);
// OK if `value` is in [min, max].
absl::Status CheckRange(double value, double min, double max, const std::string& where);

}  // namespace romap::wire
