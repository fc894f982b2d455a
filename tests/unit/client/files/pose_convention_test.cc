#include "client/files/pose_convention.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace romap::files::pose_convention_test {

using ::testing::HasSubstr;
using Pose = SE3<World, Camera>;

Pose CameraPose() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, -2, 3).normalized())), Eigen::Vector3d(4, 5, 6)};
}

void ExpectNear(const Pose& a, const Pose& b) { EXPECT_LT((a.Matrix() - b.Matrix()).norm(), 1e-9) << a.Matrix(); }

PoseConvention Parsed(const std::string& names) {
  PoseConvention convention;
  EXPECT_TRUE(ParseConvention(names, &convention).ok());
  return convention;
}

TEST(PoseConventionTest, OpencvLeavesThePoseUnchanged) {
  ExpectNear(ApplyConvention(Parsed("opencv"), CameraPose()), CameraPose());
}

TEST(PoseConventionTest, OpenglTurnsTheAxesOfTheCamera) {
  Eigen::Matrix4d gl = CameraPose().Matrix();
  gl.col(1) *= -1;
  gl.col(2) *= -1;
  ExpectNear(ApplyConvention(Parsed("opengl"), Pose(gl.topLeftCorner<3, 3>(), CameraPose().translation())),
             CameraPose());
}

TEST(PoseConventionTest, WorldToCameraIsInverted) {
  const SE3<Camera, World> inverse = CameraPose().Inverse();
  ExpectNear(ApplyConvention(Parsed("world_to_camera"), Pose(inverse.rotation(), inverse.translation())), CameraPose());
}

TEST(PoseConventionTest, WxyzReordersTheQuaternion) {
  const Eigen::Quaterniond q = CameraPose().rotation();
  const Eigen::Quaterniond read(q.z(), q.w(), q.x(), q.y());  // the columns x y z w have w x y z
  ExpectNear(ApplyConvention(Parsed("wxyz"), Pose(read, CameraPose().translation())), CameraPose());
}

TEST(PoseConventionTest, AnOpenglViewMatrixWithWFirst) {
  Eigen::Matrix4d gl = CameraPose().Matrix();
  gl.col(1) *= -1;
  gl.col(2) *= -1;
  const Eigen::Matrix4d view = gl.inverse();
  const Eigen::Quaterniond q(Eigen::Matrix3d(view.topLeftCorner<3, 3>()));
  const Pose read(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), view.topRightCorner<3, 1>());
  ExpectNear(ApplyConvention(Parsed("wxyz,world_to_camera,opengl"), read), CameraPose());
}

TEST(PoseConventionTest, TheOffsetIsThePoseOfTheCameraOnTheBody) {
  PoseConvention convention;
  const auto offset = ParsePoseOffset("0.1 0.2 -0.3 -0.5 0.5 -0.5 0.5");
  ASSERT_TRUE(offset.ok()) << offset.status();
  convention.offset = *offset;
  ExpectNear(ApplyConvention(convention, CameraPose() * offset->Inverse()), CameraPose());
  EXPECT_TRUE(offset->translation().isApprox(Eigen::Vector3d(0.1, 0.2, -0.3)));
  // The camera looks along the x axis of the body.
  EXPECT_TRUE((offset->rotation() * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitX()));
}

TEST(PoseConventionTest, NamesWhatIsInvalid) {
  PoseConvention convention;
  EXPECT_THAT(std::string(ParseConvention("opengl,ros", &convention).message()),
              HasSubstr("'ros' is unknown; expected opencv, opengl, world_to_camera or wxyz"));
  for (const auto& [text, message] :
       std::vector<std::pair<std::string, std::string>>{{"1 2 3", "has 3 numbers; expected 7 (tx ty tz qx qy qz qw)"},
                                                        {"0 0 0 0 0 0 1 0", "has 8 numbers"},
                                                        {"0 0 x 0 0 0 1", "'x' is not a finite number"},
                                                        {"0 0 0 0 0 0 2", "quaternion norm is 2.000"}}) {
    EXPECT_THAT(std::string(ParsePoseOffset(text).status().message()), HasSubstr(message));
  }
}

}  // namespace romap::files::pose_convention_test
