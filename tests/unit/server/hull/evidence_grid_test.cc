#include "server/hull/evidence_grid.h"

#include <gtest/gtest.h>

namespace romap::hull::evidence_grid_test {

// A grid of 2^3 cells whose first cell has this evidence.
EvidenceGrid WithFirstCell(int object, int background, int occluded) {
  EvidenceGrid grid;
  grid.Reset({.half_extents = {1, 1, 1}, .cells = 2});
  for (int i = 0; i < object; ++i) grid.Count(0, 1, CellEvidence::kObject, 1);
  for (int i = 0; i < background; ++i) grid.Count(0, 1, CellEvidence::kBackground, 1);
  for (int i = 0; i < occluded; ++i) grid.Count(0, 1, CellEvidence::kOccluded, 1);
  return grid;
}

TEST(EvidenceGridTest, RemovesCellsWithEnoughBackground) {
  const CarvingRule rule{.min_background = 2, .background_share = 0.25};
  EXPECT_TRUE(WithFirstCell(0, 1, 0).Keeps(0, rule));
  EXPECT_FALSE(WithFirstCell(0, 2, 0).Keeps(0, rule));
  EXPECT_TRUE(WithFirstCell(5, 2, 5).Keeps(0, rule)) << "2 of 12 are less than a quarter";
  EXPECT_FALSE(WithFirstCell(5, 4, 5).Keeps(0, rule));
}

TEST(EvidenceGridTest, RemovesCellsWithTooFewViewsOfTheObject) {
  const CarvingRule rule{.min_object = 2, .object_share = 0.5};
  EXPECT_FALSE(WithFirstCell(1, 0, 0).Keeps(0, rule));
  EXPECT_TRUE(WithFirstCell(2, 0, 2).Keeps(0, rule));
  EXPECT_FALSE(WithFirstCell(2, 0, 3).Keeps(0, rule)) << "2 of 5 are less than half";
  EXPECT_TRUE(WithFirstCell(0, 0, 3).Keeps(0, CarvingRule())) << "by default a cell needs no view of the object";
}

TEST(EvidenceGridTest, CroppedViewsCountOnlyForTheObjectShare) {
  EvidenceGrid grid = WithFirstCell(1, 1, 0);
  for (int i = 0; i < 8; ++i) grid.Count(0, 1, CellEvidence::kCropped, 1);
  EXPECT_FALSE(grid.Keeps(0, {.min_background = 2, .object_share = 0.25})) << "1 of 10 images shows the object";
  EXPECT_TRUE(grid.Keeps(0, {.min_background = 2, .object_share = 0.1}));
  EXPECT_FALSE(grid.Keeps(0, {.background_share = 0.5})) << "1 of 2 crops shows background";
}

TEST(EvidenceGridTest, CountsEvidencePerCellOfARow) {
  EvidenceGrid grid = WithFirstCell(0, 0, 0);
  const std::vector<CellEvidence> row = {CellEvidence::kBackground, CellEvidence::kObject};
  grid.Count(2, row, 1);
  grid.Count(4, 2, CellEvidence::kOccluded, 1);
  EXPECT_EQ(grid.Views(2, CellEvidence::kBackground), 1);
  EXPECT_EQ(grid.Views(3, CellEvidence::kObject), 1);
  EXPECT_EQ(grid.Views(3, CellEvidence::kBackground), 0);
  EXPECT_EQ(grid.Views(4, CellEvidence::kOccluded), 1);
  EXPECT_EQ(grid.Views(5, CellEvidence::kOccluded), 1);
  EXPECT_EQ(grid.Views(6, CellEvidence::kOccluded), 0);
}

TEST(EvidenceGridTest, RemovedViewsDoNotCount) {
  EvidenceGrid grid = WithFirstCell(1, 0, 0);
  const std::vector<CellEvidence> row = {CellEvidence::kBackground, CellEvidence::kNone};
  grid.Count(0, row, 1);
  grid.Count(0, row, -1);
  EXPECT_EQ(grid.Views(0, CellEvidence::kBackground), 0);
  EXPECT_EQ(grid.Views(0, CellEvidence::kObject), 1);
}

TEST(EvidenceGridTest, CellsBoundsAndContainsAgreeWithCarve) {
  EvidenceGrid grid;
  grid.Reset({.half_extents = {1, 2, 4}, .cells = 4});
  const CarvingRule rule{.min_object = 1};
  EXPECT_TRUE(grid.Bounds(rule).isEmpty());
  EXPECT_TRUE(grid.Cells(rule).empty());
  for (const Eigen::Vector3i& cell : {Eigen::Vector3i(1, 2, 0), Eigen::Vector3i(3, 2, 1)}) {
    grid.Count(grid.grid().Index(cell.x(), cell.y(), cell.z()), 1, CellEvidence::kObject, 1);
  }
  const std::vector<uint8_t> carved = grid.Carve(rule);
  EXPECT_EQ(std::count(carved.begin(), carved.end(), 1), 2);
  ASSERT_EQ(grid.Cells(rule).size(), 2u);
  for (const Eigen::Vector3d& center : grid.Cells(rule)) {
    EXPECT_TRUE(grid.Contains(center, rule));
    EXPECT_EQ(carved[*grid.grid().CellAt(center)], 1);
  }
  EXPECT_FALSE(grid.Contains({0, 0, 0}, rule));
  EXPECT_FALSE(grid.Contains({0, 0, 5}, rule)) << "outside the grid";
  EXPECT_TRUE(grid.Bounds(rule).isApprox(Eigen::AlignedBox3d(Eigen::Vector3d(-0.5, 0, -4), Eigen::Vector3d(1, 1, 0))));
}

TEST(EvidenceGridTest, ScalingKeepsTheCounts) {
  EvidenceGrid grid = WithFirstCell(1, 0, 0);
  grid.Scale(3);
  EXPECT_TRUE(grid.grid().half_extents.isApprox(Eigen::Vector3d(3, 3, 3)));
  EXPECT_TRUE(grid.Contains({-2, -2, -2}, {.min_object = 1}));
}

}  // namespace romap::hull::evidence_grid_test
