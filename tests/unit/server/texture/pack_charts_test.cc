#include "server/texture/pack_charts.h"

#include <gtest/gtest.h>

#include <random>

namespace romap::texture::pack_charts_test {

TEST(PackRectsTest, RectanglesDoNotOverlap) {
  std::mt19937 random(1);
  for (int round = 0; round < 20; ++round) {
    std::vector<Eigen::Vector2i> sizes;
    int area = 0;
    for (int i = 0; i < 60; ++i) {
      sizes.emplace_back(1 + static_cast<int>(random() % 40), 1 + static_cast<int>(random() % 40));
      area += sizes.back().prod();
    }
    const int side = static_cast<int>(std::sqrt(area / 0.8));
    const auto packed = PackRects(sizes, side);
    ASSERT_TRUE(packed.has_value()) << "does not use 80 % of the area";
    std::vector<int> covered(static_cast<size_t>(side) * static_cast<size_t>(side), 0);
    for (size_t i = 0; i < sizes.size(); ++i) {
      const Eigen::Vector2i low = packed->corner_px[i], high = low + sizes[i];
      ASSERT_GE(low.minCoeff(), 0);
      ASSERT_LE(high.maxCoeff(), side);
      for (int y = low.y(); y < high.y(); ++y) {
        for (int x = low.x(); x < high.x(); ++x) ASSERT_EQ(covered[static_cast<size_t>(y * side + x)]++, 0);
      }
    }
  }
}

TEST(PackRectsTest, WhatDoesNotFitIsRejected) {
  EXPECT_TRUE(PackRects(std::vector<Eigen::Vector2i>{{10, 10}}, 10).has_value());
  EXPECT_FALSE(PackRects(std::vector<Eigen::Vector2i>{{11, 1}}, 10).has_value());
  EXPECT_FALSE(PackRects(std::vector<Eigen::Vector2i>{{1, 11}}, 10).has_value());
  EXPECT_FALSE(PackRects(std::vector<Eigen::Vector2i>{{10, 6}, {10, 5}}, 10).has_value());
  EXPECT_TRUE(PackRects({}, 10).has_value());
}

}  // namespace romap::texture::pack_charts_test
