#include "common/geometry.h"

#include <gtest/gtest.h>

#include <type_traits>

#include "common/camera_model.h"
#include "common/status.h"

namespace romap::geometry_test {

SE3<World, Camera> SomePose() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())), Eigen::Vector3d(1, -2, 3)};
}

template <class A, class B>
concept Composable = requires(A a, B b) {
  a* b;
};
static_assert(Composable<SE3<World, Camera>, SE3<Camera, Object>>);
static_assert(!Composable<SE3<World, Camera>, SE3<World, Object>>,
              "transforms with different inner frames must not compose");

TEST(GeometryTest, InverseTimesTransformIsIdentity) {
  const Eigen::Vector3d p(0.3, 0.4, 0.5);
  EXPECT_TRUE((SomePose().Inverse() * (SomePose() * p)).isApprox(p, 1e-12));
}

TEST(GeometryTest, CompositionIsMatrixProduct) {
  const SE3<Camera, Object> T_camera_object{Eigen::Quaterniond(Eigen::AngleAxisd(-1.1, Eigen::Vector3d::UnitX())),
                                            Eigen::Vector3d(0, 5, 1)};
  const SE3<World, Object> T_world_object = SomePose() * T_camera_object;
  EXPECT_TRUE(T_world_object.Matrix().isApprox(SomePose().Matrix() * T_camera_object.Matrix(), 1e-12));
}

TEST(GeometryTest, RotationFromZToUp) {
  for (const Eigen::Vector3d& up : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0, -1, 0)}) {
    EXPECT_TRUE((RotationFromZTo(up) * Eigen::Vector3d::UnitZ()).isApprox(up, 1e-9));
  }
}

TEST(GeometryTest, ShortestRotationKeepsItsAxis) {
  const Eigen::Vector3d from(0.3, -1, 2), to(-5, 0.1, 0.4);
  const Eigen::Quaterniond rotation = ShortestRotation(from, to);
  EXPECT_TRUE((rotation * from.normalized()).isApprox(to.normalized(), 1e-12));
  const Eigen::Vector3d axis = from.cross(to);
  EXPECT_TRUE((rotation * axis).isApprox(axis, 1e-12));
}

TEST(CameraModelTest, ProjectInvertsUnproject) {
  const CameraModel camera{640, 480, 500, 510, 319.5, 239.5, {}};
  const Eigen::Vector3d ray = camera.Unproject(17, 400);
  EXPECT_TRUE(camera.Project(ray * 2.5).isApprox(Eigen::Vector2d(17, 400), 1e-12));
}

TEST(CameraModelTest, ErrorsNameTheField) {
  const CameraModel good{640, 480, 500, 510, 319.5, 239.5, {}};
  EXPECT_TRUE(ValidateCameraModel(good).ok());
  CameraModel bad = good;
  bad.width_px = 0;
  EXPECT_NE(Message(ValidateCameraModel(bad)).find("is 0x480 px"), std::string::npos);
  bad = good;
  bad.fx_px = -1;
  EXPECT_NE(Message(ValidateCameraModel(bad)).find("focal"), std::string::npos);
  bad = good;
  bad.cy_px = std::nan("");
  EXPECT_NE(Message(ValidateCameraModel(bad)).find("principal point"), std::string::npos);
  bad = good;
  bad.distortion[2] = INFINITY;
  EXPECT_NE(Message(ValidateCameraModel(bad)).find("distortion"), std::string::npos);
  for (const double readout_s : {-0.01, 1.5, std::nan("")}) {
    bad = good;
    bad.readout_s = readout_s;
    EXPECT_NE(Message(ValidateCameraModel(bad)).find("readout time must be in 0..1 s"), std::string::npos);
  }
}

}  // namespace romap::geometry_test
