#include "server/hull/voxel_grid.h"

#include <gtest/gtest.h>

namespace romap::hull::voxel_grid_test {

const VoxelGrid kGrid{.half_extents = {1, 2, 3}, .cells = 4};

TEST(VoxelGridTest, XIsTheFastestIndex) {
  EXPECT_EQ(kGrid.size(), 64u);
  EXPECT_EQ(kGrid.Index(0, 0, 0), 0u);
  EXPECT_EQ(kGrid.Index(1, 0, 0), 1u);
  EXPECT_EQ(kGrid.Index(0, 1, 0), 4u);
  EXPECT_EQ(kGrid.Index(3, 3, 3), 63u);
}

TEST(VoxelGridTest, CellsDivideTheBoxEvenly) {
  EXPECT_TRUE(kGrid.CellSize().isApprox(Eigen::Vector3d(0.5, 1, 1.5)));
  EXPECT_TRUE(kGrid.CellCenter(0, 0, 0).isApprox(Eigen::Vector3d(-0.75, -1.5, -2.25)));
  EXPECT_TRUE(kGrid.CellCenter(3, 2, 1).isApprox(Eigen::Vector3d(0.75, 0.5, -0.75)));
  EXPECT_TRUE(kGrid.BlockCenter({2, 0, 2}, 2).isApprox(Eigen::Vector3d(0.5, -1, 1.5)));
  EXPECT_TRUE(kGrid.BlockCenter({0, 0, 0}, 4).isZero());
}

TEST(VoxelGridTest, CellAtInvertsCellCenter) {
  for (int z = 0; z < 4; ++z) {
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 4; ++x) EXPECT_EQ(kGrid.CellAt(kGrid.CellCenter(x, y, z)), kGrid.Index(x, y, z));
    }
  }
}

TEST(VoxelGridTest, CellAtReturnsNothingOutsideTheBox) {
  EXPECT_EQ(kGrid.CellAt({1.01, 0, 0}), std::nullopt);
  EXPECT_EQ(kGrid.CellAt({0, -2.01, 0}), std::nullopt);
  EXPECT_EQ(kGrid.CellAt({0, 0, std::nan("")}), std::nullopt);
  EXPECT_EQ(VoxelGrid().CellAt({0, 0, 0}), std::nullopt);
}

}  // namespace romap::hull::voxel_grid_test
