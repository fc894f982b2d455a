#include "server/objects/support_height.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/unit/server/objects/observed_object.h"

namespace romap::objects::support_height_test {

ObservedObject ObserveBox() {
  SyntheticWorldOptions options;
  options.frames = 20;
  return ObserveObject(SyntheticShape::kBox, {0.10, 0.07, 0.05}, 0.4, options);
}

double BottomOf(const ObservedObject& observed) { return observed.evidence.region.ToGrid(Eigen::Vector3d::Zero()).z(); }

TEST(FindSupportHeightTest, IsTheTableAroundTheObject) {
  const ObservedObject observed = ObserveBox();
  const auto height = FindSupportHeight(observed.evidence, {});
  ASSERT_TRUE(height.has_value());
  EXPECT_NEAR(observed.evidence.region.ToWorld({0, 0, *height}).z(), 0, 1e-9);
}

// A cup on a book: background points show the table around it, but only the book's cuboid shows the book.
TEST(FindSupportHeightTest, IsTheTopOfTheObjectBelow) {
  constexpr double kBook_mu = 0.02;
  ObservedObject observed = ObserveBox();
  for (Eigen::Vector3d& p : observed.evidence.background) p.z() -= kBook_mu;
  const double own_bottom = observed.evidence.region.ToGrid(Eigen::Vector3d::Zero()).z();
  observed.evidence.supporting_tops = {own_bottom + 0.002};
  EXPECT_NEAR(FindSupportHeight(observed.evidence, {}).value_or(9), own_bottom + 0.002, 1e-9);
  // An object whose top is higher is behind it, or a duplicate of it.
  observed.evidence.supporting_tops = {own_bottom + 0.07};
  EXPECT_NEAR(FindSupportHeight(observed.evidence, {}).value_or(9), own_bottom - kBook_mu, 1e-9);
}

TEST(FindSupportHeightTest, IsTheBottomOfTheNeighborsWithoutBackgroundPoints) {
  ObservedObject observed = ObserveBox();
  observed.evidence.background.clear();
  EXPECT_FALSE(FindSupportHeight(observed.evidence, {}).has_value());
  const double own_bottom = observed.evidence.region.ToGrid(Eigen::Vector3d::Zero()).z();
  observed.evidence.neighbor_bottoms = {own_bottom - 0.001, own_bottom + 0.5, own_bottom + 0.001, own_bottom};
  EXPECT_NEAR(FindSupportHeight(observed.evidence, {}).value_or(9), own_bottom, 1e-9);
}

// A layer of points around the object, such as the rim of a pot, is not its support if the masks reach below it.
TEST(FindSupportHeightTest, IsNotAboveTheLowerEndOfTheMasks) {
  ObservedObject observed = ObserveBox();
  const double bottom = BottomOf(observed);
  for (Eigen::Vector3d& p : observed.evidence.background) p.z() += 0.05;
  std::erase_if(observed.evidence.points, [&](const Eigen::Vector3d& p) { return p.z() < bottom + 0.05; });
  EXPECT_NEAR(FindSupportHeight(observed.evidence, {}).value_or(9), bottom + 0.05, 1e-9);
  EXPECT_FALSE(FindSupportHeight(observed.evidence, MaskBase{bottom, bottom, bottom}).has_value());
  // Fewer points show the table.
  for (int i = 0; i < 8; ++i) observed.evidence.background.emplace_back(-0.05 * i, 0.1, bottom);
  EXPECT_NEAR(FindSupportHeight(observed.evidence, MaskBase{bottom, bottom, bottom}).value_or(9), bottom, 1e-9);
}

TEST(FindSupportHeightTest, NeighborsOnAnotherLevelDoNotCount) {
  ObservedObject observed = ObserveBox();
  observed.evidence.background.clear();
  const double bottom = BottomOf(observed);
  observed.evidence.neighbor_bottoms = {bottom - 0.04, bottom - 0.04, bottom + 0.002};
  EXPECT_NEAR(FindSupportHeight(observed.evidence, MaskBase{bottom, bottom, bottom}).value_or(9), bottom + 0.002, 1e-9);
  observed.evidence.neighbor_bottoms = {bottom - 0.04};
  EXPECT_FALSE(FindSupportHeight(observed.evidence, MaskBase{bottom, bottom, bottom}).has_value());
}

// Masks of a ball end above its bottom.
TEST(FindSupportHeightTest, NeighborsMayBeLowerThanTheMasksShow) {
  ObservedObject observed = ObserveBox();
  observed.evidence.background.clear();
  const double bottom = BottomOf(observed);
  observed.evidence.neighbor_bottoms = {bottom};
  const MaskBase ball{.bound = bottom + 0.04, .bottom = bottom + 0.04, .lowest = bottom + 0.01};
  EXPECT_NEAR(FindSupportHeight(observed.evidence, ball).value_or(9), bottom, 1e-9);
}

TEST(FindSupportHeightTest, IsUnknownWithoutAHull) {
  ObservedObject observed = ObserveBox();
  observed.evidence.hull_cells.clear();
  EXPECT_FALSE(FindSupportHeight(observed.evidence, {}).has_value());
}

}  // namespace romap::objects::support_height_test
