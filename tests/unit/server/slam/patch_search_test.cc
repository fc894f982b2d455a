#include "server/slam/patch_search.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::patch_search_test {

// Patches of points on the floor of the textured world, read at one pose of the orbit and searched at others.
class PatchSearchTest : public ::testing::Test {
 protected:
  PatchSearchTest() {
    const HalvedImages image(reference_->image_bgr);
    const SE3<Camera, World> T_camera_world = T_world_reference_.Inverse();
    for (int i = 0; i < 12; ++i) {
      for (int j = -6; j <= 6; ++j) {
        const Eigen::Vector3d p_world(0.35 + 0.04 * i, 0.05 * j, 0);
        const Eigen::Vector2d pixel_px = world_.camera().Project(T_camera_world * p_world);
        const cv::Point pixel(cvRound(pixel_px.x()), cvRound(pixel_px.y()));
        const bool is_inside = cv::Rect({}, reference_->labels.size()).contains(pixel);
        if (!is_inside || reference_->labels.at<uint16_t>(pixel) != 0) continue;
        const auto patch = Patch::Read(image, pixel_px, 1);
        if (patch) points_.push_back({p_world, {.patch = *patch, .keyframe = KeyframeId{1}}});
      }
    }
  }

  struct Point {
    Eigen::Vector3d p_world;
    ReferencePatch patch;
  };

  // The number of points that are found, and how many of them within half a pixel of their true pixels.
  struct Found {
    int all = 0;
    int precise = 0;
  };
  Found Search(const Frame& frame, const SE3<World, Camera>& estimate) const {
    const HalvedImages image(frame.image_bgr);
    const PatchTarget target{.camera = world_.camera(),
                             .lens = lens_,
                             .image = image,
                             .T_camera_world = estimate.Inverse(),
                             .center_world = estimate.translation()};
    Found found;
    for (const Point& point : points_) {
      const auto patch = FindPatch(point.patch, T_world_reference_, point.p_world, target);
      if (!patch) continue;
      ++found.all;
      const Eigen::Vector2d true_px = world_.camera().Project(frame.T_world_camera->Inverse() * point.p_world);
      found.precise += (patch->image_px - true_px).norm() < 0.5 ? 1 : 0;
    }
    return found;
  }

  const TexturedWorld world_;
  const RadialCorrection lens_;
  const SE3<World, Camera> T_world_reference_ = TexturedWorld::OrbitPose(0);
  const std::shared_ptr<Frame> reference_ = world_.Render(1, T_world_reference_);
  std::vector<Point> points_;
};

TEST_F(PatchSearchTest, FindsPointsFromAnotherDirection) {
  ASSERT_GT(points_.size(), 40U);
  const auto frame = world_.Render(2, TexturedWorld::OrbitPose(8));
  const Found found = Search(*frame, *frame->T_world_camera);
  EXPECT_GT(found.all, 0.5 * static_cast<double>(points_.size()));
  EXPECT_GE(found.precise, 0.9 * found.all);
}

TEST_F(PatchSearchTest, CorrectsASmallErrorOfThePose) {
  const auto frame = world_.Render(2, TexturedWorld::OrbitPose(4));
  const Found found = Search(*frame, TexturedWorld::OrbitPose(4.05));  // about half a pixel
  EXPECT_GT(found.all, 0.5 * static_cast<double>(points_.size()));
  EXPECT_GE(found.precise, 0.9 * found.all);
}

TEST_F(PatchSearchTest, FindsNothingAtAWrongPoseOrInAnotherWorld) {
  const auto frame = world_.Render(2, TexturedWorld::OrbitPose(4));
  EXPECT_LE(Search(*frame, TexturedWorld::OrbitPose(7)).all, 3);
  const auto other = TexturedWorld(320, 240, /*seed=*/9).Render(2, TexturedWorld::OrbitPose(4));
  EXPECT_LE(Search(*other, *frame->T_world_camera).all, 3);
}

TEST_F(PatchSearchTest, FindsNothingFromAVeryDifferentDirection) {
  const auto frame = world_.Render(2, TexturedWorld::OrbitPose(60));
  EXPECT_EQ(Search(*frame, *frame->T_world_camera).all, 0);
}

}  // namespace romap::slam::patch_search_test
