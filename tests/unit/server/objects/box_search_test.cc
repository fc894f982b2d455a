#include "server/objects/box_search.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "tests/unit/server/objects/observed_object.h"

namespace romap::objects {
namespace {

const Eigen::Vector3d kHalf(0.10, 0.07, 0.05);
constexpr double kYaw_rad = 0.4;

SyntheticWorldOptions FullOrbit(int frames) {
  SyntheticWorldOptions options;
  options.frames = frames;
  return options;
}

BoxCriteria CriteriaOf(const ObservedObject& observed) {
  return {.region = observed.evidence.region,
          .center = observed.evidence.center,
          .object_size_mu = observed.evidence.object_size_mu,
          .points = {},
          .support_height = {},
          .previous = {}};
}

UprightBox BoxOf(const Cuboid& cuboid, const HullRegion& region) {
  const Eigen::Vector3d center =
      Eigen::AngleAxisd(-kYaw_rad, Eigen::Vector3d::UnitZ()) * region.ToGrid(cuboid.T_world_object.translation());
  return {kYaw_rad, center - cuboid.half_extents, center + cuboid.half_extents};
}

double FaceError(const UprightBox& a, const UprightBox& b) {
  return std::max((a.low - b.low).cwiseAbs().maxCoeff(), (a.high - b.high).cwiseAbs().maxCoeff());
}

// A start for the search: every face a few pixels away from the true one.
UprightBox Displaced(UprightBox box) {
  box.low += Eigen::Vector3d(-0.03, 0.01, -0.01);
  box.high += Eigen::Vector3d(0.01, 0.04, 0.03);
  return box;
}

class BoxSearchTest : public ::testing::Test {
 protected:
  static ObservedObject ObserveBox(const MaskCorruption& damage = {}) {
    return ObserveObject(SyntheticShape::kBox, kHalf, kYaw_rad, FullOrbit(16), damage);
  }
};

TEST_F(BoxSearchTest, FindsABoxWithinAPixel) {
  const ObservedObject observed = ObserveBox();
  const BoxSearch search(CriteriaOf(observed), observed.silhouettes, kYaw_rad);
  const UprightBox truth = BoxOf(observed.truth, observed.evidence.region);
  const UprightBox found = search.Refine(Displaced(truth), 0.02);
  EXPECT_LT(FaceError(found, truth), observed.pixel_mu);
  EXPECT_LE(search.Cost(found), search.Cost(Displaced(truth)));
  EXPECT_EQ(search.Agreement(found), 1);
  EXPECT_LT(search.Looseness(found), 0.02);
}

TEST_F(BoxSearchTest, IsDeterministic) {
  const ObservedObject observed = ObserveBox();
  const UprightBox start = Displaced(BoxOf(observed.truth, observed.evidence.region));
  const UprightBox a = BoxSearch(CriteriaOf(observed), observed.silhouettes, kYaw_rad).Refine(start, 0.02);
  const UprightBox b = BoxSearch(CriteriaOf(observed), observed.silhouettes, kYaw_rad).Refine(start, 0.02);
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
}

TEST_F(BoxSearchTest, FallingShortCostsMoreThanExtendingBeyond) {
  const ObservedObject observed = ObserveBox();
  const BoxSearch search(CriteriaOf(observed), observed.silhouettes, kYaw_rad);
  UprightBox small = BoxOf(observed.truth, observed.evidence.region);
  UprightBox large = small;
  small.high.x() -= 0.02;
  large.high.x() += 0.02;
  EXPECT_GT(search.Cost(small), 2 * search.Cost(large));
  EXPECT_LT(search.Agreement(small), 0.75);
  EXPECT_EQ(search.Agreement(large), 1);
}

// The detector misses half of the object in one frame, and includes a neighbor in another one.
TEST_F(BoxSearchTest, IgnoresAFewWrongMasks) {
  const ObservedObject observed = ObserveBox([](int index, uint16_t label, cv::Mat* labels) {
    const cv::Rect box = cv::boundingRect(cv::Mat(*labels == label));
    if (index == 3) (*labels)(cv::Rect(box.x, box.y, box.width / 2, box.height)).setTo(0);
    if (index == 8) (*labels)(cv::Rect(box.x + box.width / 2, box.y, box.width, box.height)).setTo(label);
  });
  const BoxSearch search(CriteriaOf(observed), observed.silhouettes, kYaw_rad);
  const UprightBox truth = BoxOf(observed.truth, observed.evidence.region);
  const UprightBox found = search.Refine(Displaced(truth), 0.02);
  EXPECT_LT(FaceError(found, truth), 2 * observed.pixel_mu);
  EXPECT_NEAR(search.Agreement(found), 15.0 / 16, 1e-9) << "the box still covers the half mask";
}

// Masks at unrelated positions have no box in common.
TEST_F(BoxSearchTest, AgreementFallsWhenMasksContradictEachOther) {
  const ObservedObject observed = ObserveBox([](int index, uint16_t label, cv::Mat* labels) {
    labels->setTo(0);
    (*labels)(cv::Rect(40 + 53 * index % 200, 40 + 31 * index % 120, 50, 40)).setTo(label);
  });
  const BoxSearch search(CriteriaOf(observed), observed.silhouettes, kYaw_rad);
  const UprightBox found = search.Refine(BoxOf(observed.truth, observed.evidence.region), 0.02);
  EXPECT_LT(search.Agreement(found), 0.5);
}

TEST_F(BoxSearchTest, LoosenessIsHighForABall) {
  const ObservedObject observed =
      ObserveObject(SyntheticShape::kEllipsoid, Eigen::Vector3d::Constant(0.08), kYaw_rad, FullOrbit(16));
  const BoxSearch search(CriteriaOf(observed), observed.silhouettes, kYaw_rad);
  EXPECT_GT(search.Looseness(BoxOf(observed.truth, observed.evidence.region)), 0.06);
}

TEST_F(BoxSearchTest, PointsBoundADirectionThatNoMaskBounds) {
  SyntheticWorldOptions one_side = FullOrbit(6);
  one_side.sweep_deg = 10;
  const ObservedObject observed = ObserveObject(SyntheticShape::kBox, kHalf, kYaw_rad, one_side);
  const UprightBox truth = BoxOf(observed.truth, observed.evidence.region);
  BoxCriteria criteria = CriteriaOf(observed);
  criteria.support_height = truth.low.z();
  criteria.points = observed.evidence.points;
  const UprightBox found = BoxSearch(criteria, observed.silhouettes, kYaw_rad).Refine(truth, 0.02);
  EXPECT_LT(FaceError(found, truth), 0.015);
}

}  // namespace

}  // namespace romap::objects
