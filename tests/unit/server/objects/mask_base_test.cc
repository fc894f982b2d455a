#include "server/objects/mask_base.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "server/objects/detections.h"
#include "tests/support/synthetic_world.h"

namespace romap::objects::mask_base_test {

// Solids on a table that are parts of one object.
class MaskBaseTest : public ::testing::Test {
 protected:
  void Observe(std::vector<SyntheticObject> parts, SyntheticWorldOptions options = {}) {
    options.frames = frames_;
    options.permute_labels = false;
    options.objects = std::move(parts);
    pixel_mu_ = options.orbit_radius_mu / options.focal_px;
    const SyntheticWorld world(options);
    silhouettes_.clear();
    for (int i = 0; i < options.frames; ++i) {
      KeyframeView view = world.MakeKeyframe(i, world.MakeFrame(i));
      Frame frame = *view.frame;
      frame.labels = frame.labels.clone();
      frame.labels.setTo(1, frame.labels > 0);
      if (i < wrong_masks_) cv::dilate(frame.labels, frame.labels, cv::Mat::ones(25, 25, CV_8U));
      if (hidden_rows_ > 0) frame.labels.rowRange(frame.labels.rows - hidden_rows_, frame.labels.rows).setTo(9);
      const std::vector<Detection> detections = ExtractDetections(frame, {});
      view.frame = std::make_shared<const Frame>(std::move(frame));
      const std::vector<LandmarkKey> keys(detections.size(), 1);
      silhouettes_.push_back(
          MakeSilhouette(view, SubsampleMasks(view.frame->labels, detections, keys), detections[0], 0));
    }
  }

  // In the world, where the table is at 0.
  std::optional<MaskBase> Base(double size_mu) const {
    const HullRegion region{.R_world_grid = Eigen::Matrix3d::Identity(),
                            .center_world = {0.01, -0.02, 0.05},
                            .half_extents = Eigen::Vector3d::Constant(size_mu)};
    auto base = FindMaskBase(region, {0.01, 0.01, 0.02}, size_mu, silhouettes_);
    if (base) base->bound += region.center_world.z();
    if (base) base->bottom += region.center_world.z();
    return base;
  }

  int frames_ = 20;
  int wrong_masks_ = 0;
  int hidden_rows_ = 0;  // at the bottom of the image, under another mask
  double pixel_mu_ = 0;
  std::vector<Silhouette> silhouettes_;
};

SyntheticObject Box() { return {"box", SyntheticShape::kBox, {0, 0, 0.05}, {0.10, 0.07, 0.05}, 0.4}; }

TEST_F(MaskBaseTest, IsTheBottomOfABoxSeenFromAllSides) {
  Observe({Box()});
  const auto base = Base(0.27);
  ASSERT_TRUE(base.has_value());
  EXPECT_NEAR(base->bound, 0, 2 * pixel_mu_);
  EXPECT_NEAR(base->bottom, base->bound, 0.5 * pixel_mu_);
}

// The leaves are wider than the pot, so a box around the object ends above the bottom of the pot in every image.
TEST_F(MaskBaseTest, IsTheBottomOfAPotUnderWideLeaves) {
  Observe({{"pot", SyntheticShape::kBox, {0, 0, 0.05}, {0.04, 0.04, 0.05}, 0},
           {"leaves", SyntheticShape::kEllipsoid, {0, 0, 0.18}, {0.12, 0.12, 0.07}, 0}});
  const auto base = Base(0.35);
  ASSERT_TRUE(base.has_value());
  EXPECT_NEAR(base->bound, 0, 2 * pixel_mu_);
  EXPECT_NEAR(base->bottom, base->bound, 0.5 * pixel_mu_);
}

TEST_F(MaskBaseTest, ABallContinuesBelowTheBound) {
  constexpr double kRadius_mu = 0.08;
  Observe({{"ball", SyntheticShape::kEllipsoid, {0, 0, kRadius_mu}, {kRadius_mu, kRadius_mu, kRadius_mu}, 0}});
  const auto base = Base(0.23);
  ASSERT_TRUE(base.has_value());
  EXPECT_GT(base->bound, 0.05 * kRadius_mu);
  EXPECT_LT(base->bound, 0.35 * kRadius_mu);
  EXPECT_NEAR(base->bottom, 0, 0.1 * kRadius_mu);
}

// A bound is also true for few directions, only less tight.
TEST_F(MaskBaseTest, IsNotBelowTheBottomSeenFromOneSide) {
  SyntheticWorldOptions options;
  options.sweep_deg = 40;
  Observe({Box()}, options);
  const auto base = Base(0.27);
  ASSERT_TRUE(base.has_value());
  EXPECT_GT(base->bound, -2 * pixel_mu_);
  EXPECT_LT(base->bound, 0.1);
}

TEST_F(MaskBaseTest, ToleratesSomeWrongMasks) {
  wrong_masks_ = 4;
  Observe({Box()});
  const auto base = Base(0.27);
  ASSERT_TRUE(base.has_value());
  EXPECT_NEAR(base->bound, 0, 3 * pixel_mu_);
  EXPECT_NEAR(base->bottom, base->bound, 0.5 * pixel_mu_);
}

TEST_F(MaskBaseTest, IsUnknownIfAnotherObjectHidesTheLowerEnd) {
  hidden_rows_ = 120;
  Observe({Box()});
  EXPECT_FALSE(Base(0.27).has_value());
}

}  // namespace romap::objects::mask_base_test
