#include "common/scaled_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace romap::scaled_pose_test {

const SE3<World, Camera> kPose(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())), {1, 2, 3});
const SE3<Camera, Camera> kMotion(Eigen::Quaterniond(Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitX())), {0.1, 0, 0.5});

TEST(ScaledPose, ScaleOneComposesRigidly) {
  const SE3<World, Camera> composed = ScaledPose{kPose}.Compose(kMotion);
  EXPECT_LT((composed.Matrix() - (kPose * kMotion).Matrix()).norm(), 1e-15);
}

TEST(ScaledPose, ScaleMultipliesOnlyTheRelativeTranslation) {
  const SE3<World, Camera> composed = ScaledPose{kPose, 3}.Compose(kMotion);
  EXPECT_LT((composed.translation() - (kPose * Eigen::Vector3d(3 * kMotion.translation()))).norm(), 1e-14);
  EXPECT_LT(composed.rotation().angularDistance((kPose * kMotion).rotation()), 1e-7);
}

TEST(ScaledPose, RelativeInvertsCompose) {
  const ScaledPose reference{kPose, 0.7};
  const SE3<Camera, Camera> back = reference.Relative(reference.Compose(kMotion));
  EXPECT_LT((back.Matrix() - kMotion.Matrix()).norm(), 1e-14);
}

}  // namespace romap::scaled_pose_test
