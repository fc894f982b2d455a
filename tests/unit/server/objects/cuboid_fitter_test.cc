#include "server/objects/cuboid_fitter.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <vector>

#include "server/objects/footprint.h"
#include "server/objects/projection.h"
#include "tests/unit/server/objects/observed_object.h"

namespace romap::objects::cuboid_fitter_test {

const Eigen::Vector3d kHalf(0.10, 0.07, 0.05);
constexpr double kYaw_rad = 0.4;

std::optional<Cuboid> Fitted(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                             const std::optional<Cuboid>& previous) {
  const auto fit = FitCuboid(evidence, silhouettes, previous);
  if (!fit) return std::nullopt;
  EXPECT_GE(ContainedShare(fit->training_box, CuboidCorners(fit->cuboid), 1.0001), 1);
  return fit->cuboid;
}

SyntheticWorldOptions From(int frames, double sweep_deg) {
  SyntheticWorldOptions options;
  options.frames = frames;
  options.sweep_deg = sweep_deg;
  return options;
}

ObservedObject ObserveBox() { return ObserveObject(SyntheticShape::kBox, kHalf, kYaw_rad, From(20, 360)); }

TEST(CuboidFitterTest, FitsABoxWithExactMasksWithinAPixel) {
  ObservedObject observed = ObserveBox();
  observed.evidence.edge_yaw_rad = kYaw_rad;
  const auto cuboid = Fitted(observed.evidence, observed.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT(LargestFaceError(*cuboid, observed.truth), observed.pixel_mu);
  EXPECT_EQ(cuboid->confidence, 1);
}

TEST(CuboidFitterTest, FindsTheYawWithoutEdges) {
  const ObservedObject observed = ObserveBox();
  const auto cuboid = Fitted(observed.evidence, observed.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_NEAR(YawInGrid(*cuboid, observed.evidence.region.R_world_grid), kYaw_rad, 0.06);
  EXPECT_GT(CuboidIou(*cuboid, observed.truth), 0.85);
}

TEST(CuboidFitterTest, FitsARoundObjectTightly) {
  const ObservedObject observed =
      ObserveObject(SyntheticShape::kEllipsoid, Eigen::Vector3d::Constant(0.08), 0, From(20, 360));
  const auto cuboid = Fitted(observed.evidence, observed.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT(LargestFaceError(*cuboid, observed.truth), 0.1 * 0.16);
}

// An occluding neighbor widens the hull on one side; the cuboid of a round object must not follow.
TEST(CuboidFitterTest, IgnoresAHullThatIsTooWideOnOneSide) {
  ObservedObject observed =
      ObserveObject(SyntheticShape::kEllipsoid, Eigen::Vector3d::Constant(0.08), 0, From(20, 360));
  std::vector<Eigen::Vector3d> occluded;
  for (const Eigen::Vector3d& cell : observed.evidence.hull_cells)
    occluded.push_back(cell + Eigen::Vector3d(0.1, 0, 0));
  observed.evidence.hull_cells.insert(observed.evidence.hull_cells.end(), occluded.begin(), occluded.end());
  const auto cuboid = Fitted(observed.evidence, observed.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT((cuboid->T_world_object.translation() - observed.truth.T_world_object.translation()).norm(), 0.01);
}

TEST(CuboidFitterTest, PointsBoundTheDepthOfAnObjectSeenFromOneSide) {
  ObservedObject observed = ObserveObject(SyntheticShape::kBox, kHalf, kYaw_rad, From(10, 30));
  observed.evidence.edge_yaw_rad = kYaw_rad;
  const auto cuboid = Fitted(observed.evidence, observed.silhouettes, {});
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_LT(LargestFaceError(*cuboid, observed.truth), 4 * observed.pixel_mu);
}

TEST(CuboidFitterTest, KeepsTheEquivalentYawNearestToThePrevious) {
  ObservedObject observed = ObserveBox();
  observed.evidence.edge_yaw_rad = kYaw_rad;
  Cuboid previous = observed.truth;
  previous.T_world_object = {
      Eigen::Matrix3d(Eigen::AngleAxisd(kYaw_rad + std::numbers::pi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix()),
      observed.truth.T_world_object.translation()};
  const auto cuboid = Fitted(observed.evidence, observed.silhouettes, previous);
  ASSERT_TRUE(cuboid.has_value());
  EXPECT_NEAR(cuboid->half_extents.x(), kHalf.y(), observed.pixel_mu);
  EXPECT_NEAR(cuboid->half_extents.y(), kHalf.x(), observed.pixel_mu);
}

// Corners of the outline halfway up pass for a surface: the cuboid must not end there.
TEST(CuboidFitterTest, ReachesTheLowerEndOfTheMasksWithoutASupport) {
  for (const double false_surface_mu : {0.03, 0.05, 0.08}) {
    SCOPED_TRACE(false_surface_mu);
    ObservedObject observed = ObserveBox();
    observed.evidence.edge_yaw_rad = kYaw_rad;
    for (Eigen::Vector3d& p : observed.evidence.background) p.z() += false_surface_mu;
    std::erase_if(observed.evidence.points,
                  [&](const Eigen::Vector3d& p) { return observed.evidence.region.ToWorld(p).z() < false_surface_mu; });
    const auto cuboid = Fitted(observed.evidence, observed.silhouettes, {});
    ASSERT_TRUE(cuboid.has_value());
    EXPECT_LT(LargestFaceError(*cuboid, observed.truth), 2 * observed.pixel_mu);
  }
}

TEST(CuboidFitterTest, ReturnsNothingWithoutAHull) {
  ObservedObject observed = ObserveBox();
  observed.evidence.hull_cells.clear();
  EXPECT_FALSE(Fitted(observed.evidence, observed.silhouettes, {}).has_value());
}

}  // namespace romap::objects::cuboid_fitter_test
