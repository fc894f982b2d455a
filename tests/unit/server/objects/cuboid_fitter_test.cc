#include "server/objects/cuboid_fitter.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <vector>

#include "server/objects/footprint.h"
#include "server/objects/projection.h"
#include "tests/unit/server/objects/seen_object.h"

namespace romap::objects {
namespace {

const Eigen::Vector3d kHalf(0.10, 0.07, 0.05);
constexpr double kYaw_rad = 0.4;

std::optional<Cuboid> Fitted(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                             const std::optional<Cuboid>& previous) {
  const auto fit = FitCuboid(evidence, silhouettes, previous);
  if (!fit) return std::nullopt;
  EXPECT_GE(ContainedShare(fit->reach, CuboidCorners(fit->cuboid, 1), 1.0001), 1) << "the reach is the larger one";
  return fit->cuboid;
}

SyntheticWorldOptions From(int frames, double sweep_deg) {
  SyntheticWorldOptions options;
  options.frames = frames;
  options.sweep_deg = sweep_deg;
  return options;
}

SeenObject SeeBox() { return SeeObject(SyntheticShape::kBox, kHalf, kYaw_rad, From(20, 360)); }

TEST(CuboidFitterTest, ABoxWithExactMasksIsFoundToLessThanAPixel) {
  SeenObject seen = SeeBox();
  seen.evidence.edge_yaw_rad = kYaw_rad;
  const auto cuboid = Fitted(seen.evidence, seen.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT(LargestFaceError(*cuboid, seen.truth), seen.pixel_mu);
  EXPECT_EQ(cuboid->confidence, 1);
}

TEST(CuboidFitterTest, FindsTheYawWithoutEdges) {
  const SeenObject seen = SeeBox();
  const auto cuboid = Fitted(seen.evidence, seen.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_NEAR(YawInGrid(*cuboid, seen.evidence.region.R_world_grid), kYaw_rad, 0.06);
  EXPECT_GT(CuboidIou(*cuboid, seen.truth), 0.85);
}

TEST(CuboidFitterTest, ARoundThingFillsItsBox) {
  const SeenObject seen = SeeObject(SyntheticShape::kEllipsoid, Eigen::Vector3d::Constant(0.08), 0, From(20, 360));
  const auto cuboid = Fitted(seen.evidence, seen.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT(LargestFaceError(*cuboid, seen.truth), 0.1 * 0.16);
}

// What a neighbour hides widens the hull behind it; a round thing's box must not follow.
TEST(CuboidFitterTest, AHullThatIsWideOnOneSideDoesNotDrawTheBox) {
  SeenObject seen = SeeObject(SyntheticShape::kEllipsoid, Eigen::Vector3d::Constant(0.08), 0, From(20, 360));
  std::vector<Eigen::Vector3d> shadow;
  for (const Eigen::Vector3d& cell : seen.evidence.hull_cells) shadow.push_back(cell + Eigen::Vector3d(0.1, 0, 0));
  seen.evidence.hull_cells.insert(seen.evidence.hull_cells.end(), shadow.begin(), shadow.end());
  const auto cuboid = Fitted(seen.evidence, seen.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT((cuboid->T_world_object.translation() - seen.truth.T_world_object.translation()).norm(), 0.01);
}

TEST(CuboidFitterTest, PointsSayHowDeepAThingIsThatIsSeenFromOneSide) {
  SeenObject seen = SeeObject(SyntheticShape::kBox, kHalf, kYaw_rad, From(10, 30));
  seen.evidence.edge_yaw_rad = kYaw_rad;
  const auto cuboid = Fitted(seen.evidence, seen.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT(LargestFaceError(*cuboid, seen.truth), 4 * seen.pixel_mu);
}

TEST(CuboidFitterTest, KeepsTheNameOfThePreviousYaw) {
  SeenObject seen = SeeBox();
  seen.evidence.edge_yaw_rad = kYaw_rad;
  Cuboid previous = seen.truth;
  previous.T_world_object = {
      Eigen::Matrix3d(Eigen::AngleAxisd(kYaw_rad + std::numbers::pi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix()),
      seen.truth.T_world_object.translation()};
  const auto cuboid = Fitted(seen.evidence, seen.silhouettes, previous);
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_NEAR(cuboid->half_extents.x(), kHalf.y(), seen.pixel_mu);
  EXPECT_NEAR(cuboid->half_extents.y(), kHalf.x(), seen.pixel_mu);
}

TEST(CuboidFitterTest, NeedsAHull) {
  SeenObject seen = SeeBox();
  seen.evidence.hull_cells.clear();
  EXPECT_FALSE(Fitted(seen.evidence, seen.silhouettes, {}).has_value());
  EXPECT_FALSE(FindSupportHeight(seen.evidence).has_value());
}

TEST(FindSupportHeightTest, IsTheTableAroundTheThing) {
  const SeenObject seen = SeeBox();
  const auto height = FindSupportHeight(seen.evidence);
  ASSERT_TRUE(height.has_value());
  EXPECT_NEAR(seen.evidence.region.ToWorld({0, 0, *height}).z(), 0, 1e-9);
}

// A cup on a book: the table is seen all around, the book only by its own cuboid.
TEST(FindSupportHeightTest, IsTheTopOfTheThingBelow) {
  constexpr double kBook_mu = 0.02;
  SeenObject seen = SeeBox();
  for (Eigen::Vector3d& p : seen.evidence.background) p.z() -= kBook_mu;
  const double own_bottom = seen.evidence.region.ToGrid(Eigen::Vector3d::Zero()).z();
  seen.evidence.carrier_tops = {own_bottom + 0.002};
  EXPECT_NEAR(FindSupportHeight(seen.evidence).value_or(9), own_bottom + 0.002, 1e-9);
  // One whose top is above it stands behind it, or is the same thing twice.
  seen.evidence.carrier_tops = {own_bottom + 0.07};
  EXPECT_NEAR(FindSupportHeight(seen.evidence).value_or(9), own_bottom - kBook_mu, 1e-9);
}

TEST(FindSupportHeightTest, IsWhatTheNeighboursStandOnWhereNothingIsSeen) {
  SeenObject seen = SeeBox();
  seen.evidence.background.clear();
  EXPECT_FALSE(FindSupportHeight(seen.evidence).has_value());
  const double own_bottom = seen.evidence.region.ToGrid(Eigen::Vector3d::Zero()).z();
  seen.evidence.neighbour_bottoms = {own_bottom - 0.001, own_bottom + 0.5, own_bottom + 0.001, own_bottom};
  EXPECT_NEAR(FindSupportHeight(seen.evidence).value_or(9), own_bottom, 1e-9);
}

}  // namespace
}  // namespace romap::objects
