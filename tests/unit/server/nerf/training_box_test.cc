#include "server/nerf/training_box.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/nerf/math/hash_grid.h"
#include "server/nerf/model/field_model.h"

namespace romap::nerf::training_box_test {

SE3<World, Object> Pose(double yaw_rad, const Eigen::Vector3d& center) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())), center};
}

// The point of the hash grid that the box assigns to a point of the world.
Eigen::Vector3d InGrid(const TrainingBox& box, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3f unit = box.ToUnit(box.T_world_object.Inverse() * p_world).cast<float>();
  float x = unit.x(), y = unit.y(), z = unit.z();
  plain::MoveToGrid(box.GridPose(), x, y, z);
  return {x, y, z};
}

TEST(TrainingBoxTest, TheGridStaysInTheWorldWhenTheBoxIsRefitted) {
  const TrainingBox first = TrainingBox::Around({Pose(0.3, {1, 2, 3}), {0.5, 0.3, 0.2}, 1}, 0.1);
  const TrainingBox second = first.Refitted({Pose(1.1, {1.1, 1.8, 3.1}), {0.7, 0.2, 0.2}, 1}, 0.1);
  const TrainingBox third = second.Refitted({Pose(-2.0, {0.9, 2.0, 2.9}), {0.1, 0.4, 0.3}, 1}, 0.0);
  EXPECT_NEAR(first.unit_mu, 1.1, 1e-12);
  EXPECT_EQ(third.unit_mu, first.unit_mu);
  EXPECT_NEAR(third.LongestSide_mu(), 0.8 * 1.02, 1e-12) << "no enlargement, but a margin";
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(1.4, 1.7, 3.2)}) {
    EXPECT_TRUE(InGrid(second, p).isApprox(InGrid(first, p), 1e-5));
    EXPECT_TRUE(InGrid(third, p).isApprox(InGrid(first, p), 1e-5));
  }
  EXPECT_TRUE(first.ToUnit(-first.half_extents).isZero(1e-12));
}

TEST(TrainingBoxTest, ACorrectionMovesTheGrid) {
  const TrainingBox box = TrainingBox::Around({Pose(0.3, {1, 2, 3}), {0.5, 0.3, 0.2}, 1}, 0.1)
                              .Refitted({Pose(0.8, {1, 2, 3.1}), {0.6, 0.3, 0.2}, 1}, 0.1);
  const Sim3<World, World> S(0.7, Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX())), {1, -1, 0});
  const Eigen::Vector3d p(1.2, 1.9, 3.0);
  EXPECT_TRUE(InGrid(box.Moved(S), S * p).isApprox(InGrid(box, p), 1e-5));
}

TEST(TrainingBoxTest, SharesMeasureTheOverlapOfTwoBoxes) {
  const TrainingBox box = TrainingBox::Around({Pose(0, {0, 0, 0}), {1, 1, 1}, 1}, 0.1);
  const TrainingBox twice = box.Refitted({Pose(0, {1, 0, 0}), {2, 1, 1}, 1}, 0.1);
  EXPECT_NEAR(box.ShareCovered(box), 1, 1e-12);
  EXPECT_NEAR(twice.ShareCovered(box), 1, 1e-12);
  EXPECT_NEAR(box.ShareCovered(twice), 0.5, 0.07);
  EXPECT_TRUE((box.ShareOf(twice) * Eigen::Vector3d(0, 0.5, 0.5)).isApprox(Eigen::Vector3d(-0.1 / 2.2, 0.5, 0.5)));
  const TrainingBox turned = box.Refitted({Pose(M_PI / 2, {0, 0, 0}), {1, 1, 1}, 1}, 0.1);
  EXPECT_TRUE((box.ShareOf(turned) * Eigen::Vector3d(1, 0.5, 0)).isApprox(Eigen::Vector3d(0.5, 1, 0), 1e-9));
  EXPECT_EQ(box.ShareCovered(box.Refitted({Pose(0, {9, 0, 0}), {1, 1, 1}, 1}, 0.1)), 0);
}

TEST(HashGridTest, CornersOfADenseLevelAreDistinctInAnyWindowAroundTheFirstBox) {
  const GridLayout layout = nerf::MakeGridLayout(NerfConfig{});
  ASSERT_EQ(layout.stride_z[0], layout.stride_y[0] * layout.stride_y[0]) << "the coarsest level is dense";
  const auto window = static_cast<int>(layout.stride_y[0]);
  EXPECT_GE(window, 1.4 * layout.scale[0]);
  for (const Eigen::Vector3i& from : {Eigen::Vector3i(0, 0, 0), Eigen::Vector3i(-6, 3, -9)}) {
    std::vector<int> uses(layout.mask[0] + 1u, 0);
    for (int i = 0; i < window * window * window; ++i) {
      const Eigen::Vector3i corner = from + Eigen::Vector3i(i % window, i / window % window, i / (window * window));
      const Eigen::Vector3f p = (corner.cast<float>().array() + 0.01f - 0.5f) / layout.scale[0];
      const auto cell = plain::LocateCell(p.x(), p.y(), p.z(), layout.scale[0], layout.stride_y[0], layout.stride_z[0],
                                          layout.mask[0], layout.offset[0]);
      ASSERT_LE(++uses[cell.pair[0] - layout.offset[0]], 1) << corner.transpose();
      ASSERT_NEAR(cell.along_x, 0.01f, 1e-4);
    }
  }
}

}  // namespace romap::nerf::training_box_test
