#include "common/wire/geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/wire/enums.h"

namespace romap::wire {
namespace {

// Allows for rounding to 32-bit floats or to the digits of a text file.
constexpr double kMaxNormError = 1e-3;

}  // namespace

v1::Vector3 ToProto(const Eigen::Vector3d& vector) {
  v1::Vector3 proto;
  proto.set_x(vector.x());
  proto.set_y(vector.y());
  proto.set_z(vector.z());
  return proto;
}

v1::Quaternion ToProto(const Eigen::Quaterniond& quaternion) {
  v1::Quaternion proto;
  proto.set_x(quaternion.x());
  proto.set_y(quaternion.y());
  proto.set_z(quaternion.z());
  proto.set_w(quaternion.w());
  return proto;
}

v1::Camera ToProto(const CameraModel& camera) {
  v1::Camera proto;
  proto.set_width_px(static_cast<uint32_t>(camera.width_px));
  proto.set_height_px(static_cast<uint32_t>(camera.height_px));
  proto.set_fx_px(camera.fx_px);
  proto.set_fy_px(camera.fy_px);
  proto.set_cx_px(camera.cx_px);
  proto.set_cy_px(camera.cy_px);
  proto.set_lens(EnumToProto(kLensModels, camera.lens));
  proto.set_readout_s(camera.readout_s);
  if (camera.HasDistortion()) {
    proto.mutable_distortion()->Add(camera.distortion.begin(),
                                    camera.distortion.begin() + CoefficientCount(camera.lens));
  }
  return proto;
}

absl::StatusOr<Eigen::Vector3d> VectorFromProto(const v1::Vector3& proto, const std::string& where) {
  const Eigen::Vector3d vector(proto.x(), proto.y(), proto.z());
  if (!vector.allFinite()) {
    return InvalidArgument("{}: must be finite, is ({}, {}, {})", where, proto.x(), proto.y(), proto.z());
  }
  return vector;
}

absl::StatusOr<Eigen::Quaterniond> QuaternionFromProto(const v1::Quaternion& proto, const std::string& where) {
  const Eigen::Quaterniond quaternion(proto.w(), proto.x(), proto.y(), proto.z());
  const double norm = quaternion.norm();
  if (!(std::abs(norm - 1) <= kMaxNormError)) {  // NaN fails the comparison
    return InvalidArgument("{}: must be a unit quaternion, is ({}, {}, {}, {}) with norm {}", where, proto.x(),
                           proto.y(), proto.z(), proto.w(), norm);
  }
  return quaternion.normalized();
}

absl::StatusOr<CameraModel> CameraFromProto(const v1::Camera& proto, const std::string& where) {
  constexpr uint32_t kMaxInt = std::numeric_limits<int>::max();
  if (proto.width_px() > kMaxInt || proto.height_px() > kMaxInt) {
    return InvalidArgument("{}: size must be in 16..8192 px, is {}x{} px", where, proto.width_px(), proto.height_px());
  }
  CameraModel camera;
  camera.width_px = static_cast<int>(proto.width_px());
  camera.height_px = static_cast<int>(proto.height_px());
  camera.fx_px = proto.fx_px();
  camera.fy_px = proto.fy_px();
  camera.cx_px = proto.cx_px();
  camera.cy_px = proto.cy_px();
  camera.readout_s = proto.readout_s();
  ROMAP_ASSIGN_OR_RETURN(camera.lens, EnumFromProto(kLensModels, proto.lens(), where + ".lens"));
  if (proto.distortion_size() != 0 && proto.distortion_size() != CoefficientCount(camera.lens)) {
    return InvalidArgument("{}.distortion: must have no coefficients or {}, has {}", where,
                           camera.lens == LensModel::kFisheye ? "4 (k1 k2 k3 k4)" : "5 (k1 k2 p1 p2 k3)",
                           proto.distortion_size());
  }
  std::copy(proto.distortion().begin(), proto.distortion().end(), camera.distortion.begin());
  return camera;
}

absl::Status CheckFinite(double value, const std::string& where) {
  if (std::isfinite(value)) return absl::OkStatus();
  return InvalidArgument("{}: must be finite, is {}", where, value);
}

absl::Status CheckRange(double value, double min, double max, const std::string& where) {
  if (value >= min && value <= max) return absl::OkStatus();  // NaN fails the comparisons
  return InvalidArgument("{}: must be in {}..{}, is {}", where, min, max, value);
}

}  // namespace romap::wire
