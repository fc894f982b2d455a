#include "server/objects/shape_fitter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/synthetic_world.h"

namespace romap::objects::shape_fitter_test {

using ::testing::SizeIs;

SyntheticWorldOptions TwoObjects() {
  SyntheticWorldOptions options;
  options.objects = {{"box", SyntheticShape::kBox, {-0.25, 0, 0.06}, {0.10, 0.08, 0.06}, 0.3},
                     {"ball", SyntheticShape::kEllipsoid, {0.25, 0.1, 0.07}, {0.07, 0.07, 0.07}, 0}};
  options.frames = 16;
  options.keyframe_every = 1;
  options.permute_labels = false;
  return options;
}

// A store with one landmark per object of the world, whose masks are assigned to it.
class ShapeFitterTest : public ::testing::Test {
 protected:
  ShapeFitterTest() {
    for (size_t i = 0; i < world_.objects().size(); ++i) store_.Create();
  }

  // Adds the masks of a keyframe. Object i of the world has label i + 1.
  void AddKeyframe(int index, bool unambiguous = true) {
    const TrackedFrame tracked = world_.MakeFrame(index);
    const KeyframeView view = world_.MakeKeyframe(index, tracked);
    FrameDetections frame{.usable = true, .frame_id = 1, .detections = {}, .keys = {}, .unambiguous = {}};
    frame.detections = ExtractDetections(*tracked.frame, config_);
    for (const Detection& detection : frame.detections) {
      frame.keys.push_back(store_.Keys()[detection.label - 1u]);
      frame.unambiguous.push_back(unambiguous);
    }
    store_.UpdatePoints(view);
    store_.CountPointVotes(view, frame);
    fitter_.AddSilhouettes(view, frame, {}, &store_);
  }

  ObjectsConfig config_;
  const SyntheticWorld world_{TwoObjects()};
  LandmarkStore store_{config_};
  ShapeFitter fitter_{config_};
};

TEST_F(ShapeFitterTest, FitsTheCuboidOfEveryLandmark) {
  for (int i = 0; i < world_.frame_count(); ++i) AddKeyframe(i);
  fitter_.FitAll(/*frame_index=*/16, {}, &store_);
  for (size_t i = 0; i < store_.landmarks().size(); ++i) {
    const Landmark& landmark = *store_.landmarks()[i];
    ASSERT_TRUE(landmark.geometry.cuboid.has_value()) << world_.objects()[i].class_name;
    EXPECT_GT(CuboidIou(*landmark.geometry.cuboid, world_.TrueCuboid(static_cast<int>(i))), 0.6)
        << world_.objects()[i].class_name;
    EXPECT_FALSE(landmark.geometry.points.empty());
    EXPECT_FALSE(landmark.needs_fit);
    EXPECT_EQ(landmark.last_fit_frame, 16u);
  }
}

TEST_F(ShapeFitterTest, AmbiguousMasksAreIgnored) {
  for (int i = 0; i < 4; ++i) AddKeyframe(i, /*unambiguous=*/false);
  for (const auto& landmark : store_.landmarks()) {
    EXPECT_TRUE(landmark->shape.silhouettes().empty());
    EXPECT_EQ(landmark->evidence.keyframe_observations, 0);
    EXPECT_FALSE(landmark->needs_fit);
  }
}

TEST_F(ShapeFitterTest, RedundantMasksAreCountedButNotKept) {
  AddKeyframe(0);
  AddKeyframe(0);
  const Landmark& landmark = *store_.landmarks()[0];
  EXPECT_EQ(landmark.evidence.keyframe_observations, 2);
  EXPECT_THAT(landmark.shape.silhouettes(), SizeIs(1));
}

TEST_F(ShapeFitterTest, FitsAtMostTheConfiguredNumberPerKeyframe) {
  for (int i = 0; i < 8; ++i) AddKeyframe(i);
  ASSERT_EQ(config_.cuboid_fits_per_keyframe, 1);
  const std::vector<LandmarkKey> first = fitter_.FitMostUrgent(/*frame_index=*/8, {}, &store_);
  const std::vector<LandmarkKey> second = fitter_.FitMostUrgent(/*frame_index=*/9, {}, &store_);
  ASSERT_THAT(first, SizeIs(1));
  ASSERT_THAT(second, SizeIs(1));
  EXPECT_NE(first[0], second[0]) << "the other landmark waited";
  EXPECT_TRUE(fitter_.FitMostUrgent(/*frame_index=*/10, {}, &store_).empty()) << "no landmark changed";
}

}  // namespace romap::objects::shape_fitter_test
