#include "server/mesh/view_depth.h"

#include <gtest/gtest.h>

#include "server/mesh/sample_field.h"
#include "server/mesh/visibility.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::mesh::view_depth_test {

using Relation = ViewDepth::Relation;

constexpr float kMaxOpticalDepth = 0.2f;

// A sphere of radius 0.5 in the box, seen from z = -3.
class ViewDepthTest : public ::testing::Test {
 protected:
  ViewDepth Make() const {
    return {grid_, NodeOpticalDepths(grid_, snapshot_.optics.surface_density_per_mu, kMaxOpticalDepth),
            kMaxOpticalDepth, view_};
  }
  void Paint(RayKind kind) { view_.ray_kind.setTo(static_cast<int>(kind)); }

  FieldSnapshot snapshot_ = SnapshotOf(Sphere(0.5f));
  FieldGrid grid_ = SampleField(snapshot_, SurfaceProbe(snapshot_), Eigen::Vector3i::Constant(64)).grid;
  TrainingCamera view_ = ViewFrom({0, 0, -3});
};

TEST_F(ViewDepthTest, PointsBeforeAndBehindTheSurface) {
  const ViewDepth depth = Make();
  EXPECT_EQ(depth.Relate({0, 0, -0.9f}), Relation::kInFront);
  EXPECT_EQ(depth.Relate({0, 0, -0.56f}), Relation::kInFront);
  EXPECT_EQ(depth.Relate({0, 0, -0.44f}), Relation::kBehind);
  EXPECT_EQ(depth.Relate({0, 0, 0.9f}), Relation::kBehind);
}

TEST_F(ViewDepthTest, PointsOutsideTheCropOrBehindTheCameraAreUnknown) {
  view_.roi_px = {150, 150, 100, 100};
  view_.ray_kind = cv::Mat(100, 100, CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kObject)));
  const ViewDepth depth = Make();
  EXPECT_EQ(depth.Relate({0, 0, -0.9f}), Relation::kInFront);
  EXPECT_EQ(depth.Relate({0.9f, 0, -0.9f}), Relation::kUnknown);
  EXPECT_EQ(depth.Relate({0, 0, -4}), Relation::kUnknown);
}

// A mask that is larger than the object does not make the space around it solid.
TEST_F(ViewDepthTest, SpaceOnARayThatHitsNoSurfaceIsEmpty) {
  const Eigen::Vector3f beside_sphere(0.8f, 0.8f, 0);
  for (const RayKind kind : {RayKind::kObject, RayKind::kBackground}) {
    Paint(kind);
    EXPECT_EQ(Make().Relate(beside_sphere), Relation::kInFront);
  }
}

TEST_F(ViewDepthTest, PointsOnTheRayOfAnOccluderAreUnknown) {
  Paint(RayKind::kOccluder);
  EXPECT_EQ(Make().Relate({0, 0, -0.9f}), Relation::kUnknown);
}

TEST_F(ViewDepthTest, PointsAreUnknownIfThePoseIsNotFinite) {
  view_.T_camera_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Constant(NAN)};
  EXPECT_EQ(Make().Relate({0, 0, -0.9f}), Relation::kUnknown);
}

}  // namespace romap::mesh::view_depth_test
