#include "server/nerf/model/occupancy.h"

#include <gtest/gtest.h>

#include <vector>

namespace romap::nerf::occupancy_test {

TEST(OccupancyTest, ScoresMoveToAnotherBox) {
  constexpr int kSide = kOccupancyResolution;
  NerfConfig config;
  config.occupancy_decay = 0;
  Occupancy occupancy(config);
  const auto index = [](int x, int y, int z) { return static_cast<uint32_t>((z * kSide + y) * kSide + x); };
  // A sheet one cell thick; all other cells are empty.
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) occupancy.Record(index(x, y, z), x == 21 ? 1.0f : 0.0f);
    }
  }
  // The new box is twice as long along x, from the same lowest corner.
  occupancy.MoveTo(Eigen::Affine3f(Eigen::Scaling(2.0f, 1.0f, 1.0f)));
  occupancy.SetHull(std::vector<uint8_t>(static_cast<size_t>(kSide) * kSide * kSide, 1));
  const auto occupied = [&](int x, int y, int z) {
    const uint32_t cell = index(x, y, z);
    return (occupancy.bits()[cell / 32] >> (cell % 32) & 1u) != 0;
  };
  for (int x = 0; x < kSide; ++x) {
    EXPECT_EQ(occupied(x, 30, 30), (x >= 9 && x <= 11) || x >= 31)
        << x;  // dilated by one cell; beyond 32 outside the old box
  }
}

TEST(OccupancyTest, TrimmedHullEndsWhereRaysEnd) {
  constexpr uint32_t kRow = kOccupancyResolution, kLayer = kRow * kRow;
  Occupancy occupancy(NerfConfig{});
  for (uint32_t z = 20; z < 50; ++z) {
    for (uint32_t x = 10; x < 60; ++x) occupancy.Record(z * kLayer + 30 * kRow + x, 0.5f);
  }
  const std::vector<uint8_t> hull = occupancy.TrimmedHull(0.002);
  const auto at = [&](uint32_t x, uint32_t y, uint32_t z) { return hull[z * kLayer + y * kRow + x]; };
  EXPECT_EQ(at(30, 30, 19), 1);  // one layer of margin
  EXPECT_EQ(at(30, 30, 18), 0);
  EXPECT_EQ(at(30, 30, 50), 1);
  EXPECT_EQ(at(30, 30, 51), 0);
  EXPECT_EQ(at(8, 30, 30), 0);
  EXPECT_EQ(at(30, 28, 30), 0);
  EXPECT_EQ(occupancy.TrimmedHull(0), occupancy.hull());
}

}  // namespace romap::nerf::occupancy_test
