#include "server/hull/grid_projection.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace romap::hull::grid_projection_test {

const CameraModel kCamera{.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 510, .cx_px = 320, .cy_px = 240};
const VoxelGrid kGrid{.half_extents = {0.4, 0.3, 0.5}, .cells = 20};

GridProjection ProjectionAt(double distance) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 0.5).normalized()).toRotationMatrix();
  return GridProjection::Of(kCamera, R, {0.05, -0.02, distance});
}

TEST(GridProjectionTest, AgreesWithTheCameraModel) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Vector3d t(0.1, 0.2, 2);
  const GridProjection projection = GridProjection::Of(kCamera, R, t);
  const Eigen::Vector3d p(0.3, -0.1, 0.2);
  const Eigen::Vector3d q = projection * p;
  EXPECT_NEAR(q.z(), (R * p + t).z(), 1e-12);
  EXPECT_TRUE((q / q.z()).head<2>().isApprox(kCamera.Project(R * p + t), 1e-12));
}

TEST(RowProjectorTest, AgreesWithTheProjectionOfEachCell) {
  const GridProjection projection = ProjectionAt(1.5);
  RowProjector rows(projection, kGrid);
  for (int z = 0; z < kGrid.cells; z += 3) {
    for (int y = 0; y < kGrid.cells; y += 3) {
      ASSERT_TRUE(rows.Project(y, z));
      for (int x = 0; x < kGrid.cells; ++x) {
        const Eigen::Vector3d q = projection * kGrid.CellCenter(x, y, z);
        EXPECT_NEAR(rows.u_px()[x], q.x() / q.z(), 1e-3);
        EXPECT_NEAR(rows.v_px()[x], q.y() / q.z(), 1e-3);
        EXPECT_TRUE((rows.first() + x * rows.step()).isApprox(q, 1e-9));
      }
    }
  }
}

TEST(RowProjectorTest, RejectsRowsThatReachBehindTheCamera) {
  const GridProjection projection = ProjectionAt(0.1);
  RowProjector rows(projection, kGrid);
  int rejected = 0;
  for (int z = 0; z < kGrid.cells; ++z) {
    for (int y = 0; y < kGrid.cells; ++y) {
      double min_depth = 1;
      for (int x = 0; x < kGrid.cells; ++x) {
        min_depth = std::min(min_depth, (projection * kGrid.CellCenter(x, y, z)).z());
      }
      EXPECT_EQ(rows.Project(y, z), min_depth > 1e-9) << "row " << y << " " << z;
      rejected += min_depth > 1e-9 ? 0 : 1;
    }
  }
  EXPECT_GT(rejected, 10);
}

}  // namespace romap::hull::grid_projection_test
