include<gtest / gtest.h> #include "server/objects/box_search.h" include<gtest / gtest.h>
    include<gtest / gtest.h> #include<gtest / gtest.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/imgproc.hpp>
        include<gtest / gtest.h> include<gtest / gtest.h> #include
    "tests/unit/server/objects/seen_object.h" include<gtest / gtest.h>
        include<gtest / gtest.h> namespace romap {
  include<gtest / gtest.h> namespace {
    include<gtest / gtest.h> include<gtest / gtest.h> const Eigen::Vector3d kHalf(0.10, 0.07, 0.05);
    include<gtest / gtest.h> constexpr double kYaw_rad = 0.4;
    include<gtest / gtest.h> include<gtest / gtest.h> SyntheticWorldOptions Around(int frames) {
      include<gtest / gtest.h> SyntheticWorldOptions options;
      include<gtest / gtest.h> options.frames = frames;
      include<gtest / gtest.h> return options;
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> BoxCriteria CriteriaOf(const SeenObject& seen) {
      include<gtest / gtest.h> return {.region = seen.evidence.region,
                                       include<gtest / gtest.h>.center = seen.evidence.center,
                                       include<gtest / gtest.h>.object_size_mu = seen.evidence.object_size_mu,
                                       include<gtest / gtest.h>.points = {},
                                       include<gtest / gtest.h>.support_height = {},
                                       include<gtest / gtest.h>.previous = {}};
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> UprightBox BoxOf(const Cuboid& cuboid, const HullRegion& region) {
      include<gtest / gtest.h> const Eigen::Vector3d center =
          Eigen::AngleAxisd(-kYaw_rad, Eigen::Vector3d::UnitZ()) *
          include<gtest / gtest.h> region.ToGrid(cuboid.T_world_object.translation());
      include<gtest / gtest.h> return {kYaw_rad, center - cuboid.half_extents, center + cuboid.half_extents};
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> double FaceError(const UprightBox& a, const UprightBox& b) {
      include<gtest / gtest.h> return std::max((a.low - b.low).cwiseAbs().maxCoeff(),
                                               (a.high - b.high).cwiseAbs().maxCoeff());
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> UprightBox Off(UprightBox box) {
      include<gtest / gtest.h> box.low += Eigen::Vector3d(-0.03, 0.01, -0.01);
      include<gtest / gtest.h> box.high += Eigen::Vector3d(0.01, 0.04, 0.03);
      include<gtest / gtest.h> return box;
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> class BoxSearchTest : public ::testing::Test {
      include<gtest / gtest.h> protected : include<gtest / gtest.h> static SeenObject SeeBox(
                                               const MaskDamager& damage = {}) {
        include<gtest / gtest.h> return SeeObject(SyntheticShape::kBox, kHalf, kYaw_rad, Around(16), damage);
        include<gtest / gtest.h>
      }
      include<gtest / gtest.h>
    };
    include<gtest / gtest.h> include<gtest / gtest.h> TEST_F(BoxSearchTest, FindsABoxToLessThanAPixel) {
      include<gtest / gtest.h> const SeenObject seen = SeeBox();
      include<gtest / gtest.h> const BoxSearch search(CriteriaOf(seen), seen.silhouettes, kYaw_rad);
      include<gtest / gtest.h> const UprightBox truth = BoxOf(seen.truth, seen.evidence.region);
      include<gtest / gtest.h> const UprightBox found = search.Refine(Off(truth), 0.02);
      include<gtest / gtest.h> EXPECT_LT(FaceError(found, truth), seen.pixel_mu);
      include<gtest / gtest.h> EXPECT_LE(search.Cost(found), search.Cost(Off(truth)));
      include<gtest / gtest.h> EXPECT_EQ(search.Agreement(found), 1);
      include<gtest / gtest.h> EXPECT_LT(search.Looseness(found), 0.02);
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> TEST_F(BoxSearchTest, GivesTheSameToTheLastBit) {
      include<gtest / gtest.h> const SeenObject seen = SeeBox();
      include<gtest / gtest.h> const UprightBox start = Off(BoxOf(seen.truth, seen.evidence.region));
      include<gtest / gtest.h> const UprightBox a =
          BoxSearch(CriteriaOf(seen), seen.silhouettes, kYaw_rad).Refine(start, 0.02);
      include<gtest / gtest.h> const UprightBox b =
          BoxSearch(CriteriaOf(seen), seen.silhouettes, kYaw_rad).Refine(start, 0.02);
      include<gtest / gtest.h> EXPECT_EQ(a.low, b.low);
      include<gtest / gtest.h> EXPECT_EQ(a.high, b.high);
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> TEST_F(BoxSearchTest, NotCoveringCostsMoreThanReachingFarther) {
      include<gtest / gtest.h> const SeenObject seen = SeeBox();
      include<gtest / gtest.h> const BoxSearch search(CriteriaOf(seen), seen.silhouettes, kYaw_rad);
      include<gtest / gtest.h> UprightBox small = BoxOf(seen.truth, seen.evidence.region);
      include<gtest / gtest.h> UprightBox large = small;
      include<gtest / gtest.h> small.high.x() -= 0.02;
      include<gtest / gtest.h> large.high.x() += 0.02;
      include<gtest / gtest.h> EXPECT_GT(search.Cost(small), 2 * search.Cost(large));
      include<gtest / gtest.h> EXPECT_LT(search.Agreement(small), 0.5);
      include<gtest / gtest.h> EXPECT_EQ(search.Agreement(large), 1);
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h>
        include<gtest / gtest.h>  // A detector that loses half of a thing at times, or takes the one beside it along.
            include<gtest / gtest.h> TEST_F(BoxSearchTest, OutvotesLiars) {
      include<gtest / gtest.h> const SeenObject seen = SeeBox([](int index, uint16_t label, cv::Mat* labels) {
        include<gtest / gtest.h> const cv::Rect box = cv::boundingRect(cv::Mat(*labels == label));
        include<gtest / gtest.h> if (index == 3) (*labels)(cv::Rect(box.x, box.y, box.width / 2, box.height)).setTo(0);
        include<gtest / gtest.h> if (index ==
                                     8) (*labels)(cv::Rect(box.x + box.width / 2, box.y, box.width, box.height))
            .setTo(label);
        include<gtest / gtest.h>
      });
      include<gtest / gtest.h> const BoxSearch search(CriteriaOf(seen), seen.silhouettes, kYaw_rad);
      include<gtest / gtest.h> const UprightBox truth = BoxOf(seen.truth, seen.evidence.region);
      include<gtest / gtest.h> const UprightBox found = search.Refine(Off(truth), 0.02);
      include<gtest / gtest.h> EXPECT_LT(FaceError(found, truth), 2 * seen.pixel_mu);
      include<gtest / gtest.h> EXPECT_NEAR(search.Agreement(found), 15.0 / 16,
                                           1e-9);  // the box covers what is left of a half mask
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h>  // Masks that show now this, now that have no box in common.
        include<gtest / gtest.h> TEST_F(BoxSearchTest, AgreementFallsWhenMasksContradictEachOther) {
      include<gtest / gtest.h> const SeenObject seen = SeeBox([](int index, uint16_t label, cv::Mat* labels) {
        include<gtest / gtest.h> labels->setTo(0);
        include<gtest / gtest.h> (*labels)(cv::Rect(40 + 53 * index % 200, 40 + 31 * index % 120, 50, 40)).setTo(label);
        include<gtest / gtest.h>
      });
      include<gtest / gtest.h> const BoxSearch search(CriteriaOf(seen), seen.silhouettes, kYaw_rad);
      include<gtest / gtest.h> const UprightBox found = search.Refine(BoxOf(seen.truth, seen.evidence.region), 0.02);
      include<gtest / gtest.h> EXPECT_LT(search.Agreement(found), 0.5);
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> TEST_F(BoxSearchTest, ABallIsLooseInItsBox) {
      include<gtest / gtest.h> const SeenObject seen = include<gtest / gtest.h> SeeObject(
          SyntheticShape::kEllipsoid, Eigen::Vector3d::Constant(0.08), kYaw_rad, Around(16));
      include<gtest / gtest.h> const BoxSearch search(CriteriaOf(seen), seen.silhouettes, kYaw_rad);
      include<gtest / gtest.h> EXPECT_GT(search.Looseness(BoxOf(seen.truth, seen.evidence.region)), 0.06);
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h> TEST_F(BoxSearchTest, PointsBoundWhatNoMaskDoes) {
      include<gtest / gtest.h> SyntheticWorldOptions one_side = Around(6);
      include<gtest / gtest.h> one_side.sweep_deg = 10;
      include<gtest / gtest.h> const SeenObject seen = SeeObject(SyntheticShape::kBox, kHalf, kYaw_rad, one_side);
      include<gtest / gtest.h> const UprightBox truth = BoxOf(seen.truth, seen.evidence.region);
      include<gtest / gtest.h> BoxCriteria criteria = CriteriaOf(seen);
      include<gtest / gtest.h> criteria.support_height = truth.low.z();
      include<gtest / gtest.h> UprightBox start = truth;
      include<gtest / gtest.h> start.low.x() += 0.08;
      include<gtest / gtest.h> const double without =
          FaceError(BoxSearch(criteria, seen.silhouettes, kYaw_rad).Refine(start, 0.02), truth);
      include<gtest / gtest.h> criteria.points = seen.evidence.points;
      include<gtest / gtest.h> const double with =
          FaceError(BoxSearch(criteria, seen.silhouettes, kYaw_rad).Refine(start, 0.02), truth);
      include<gtest / gtest.h> EXPECT_LE(with, without);
      include<gtest / gtest.h> EXPECT_LT(with, 0.015);
      include<gtest / gtest.h>
    }
    include<gtest / gtest.h> include<gtest / gtest.h>
  }  // namespace
  include<gtest / gtest.h>
}  // namespace romap
