#include "server/slam/mask_voter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::mask_voter_test {

constexpr uint16_t kLabel = 5;
constexpr double kDepth_mu = 5;

// Two keyframes without masks that observe a row of points, and masks over the first columns of an image.
class MaskVoterTest : public ::testing::Test {
 protected:
  static constexpr int kPoints = 15;

  MaskVoterTest() {
    first_ = AddKeyframe(1, 0);
    second_ = AddKeyframe(5, 0.2);
    for (int i = 0; i < kPoints; ++i) {
      PointTrack& track = map_.AddPoint(PointAt(i));
      map_.AddObservation(track, *map_.FindKeyframe(first_), i);
      map_.AddObservation(track, *map_.FindKeyframe(second_), i);
      map_.Refresh(track);
      points_.push_back(track.point.id);
    }
  }

  // At pixel 20 + 20 i of the first keyframe.
  Eigen::Vector3d PointAt(int i) const { return kDepth_mu * camera_.Unproject(20 + 20.0 * i, 120); }

  KeyframeId AddKeyframe(uint64_t frame_id, double x_mu) {
    Frame frame;
    frame.frame_id = frame_id;
    frame.camera = camera_;
    std::vector<Feature> features(kPoints);
    for (int i = 0; i < kPoints; ++i) {
      const Eigen::Vector3d p_camera = PointAt(i) - Eigen::Vector3d(x_mu, 0, 0);
      features[static_cast<size_t>(i)].pixel_px = camera_.Project(p_camera).cast<float>();
    }
    return map_.AddKeyframe(MakeFrameFeatures(frame, features), {Eigen::Quaterniond::Identity(), {x_mu, 0, 0}}).id;
  }

  // A frame whose reference is the second keyframe, displaced from it along x.
  TrackedFrame FrameNearSecond(uint64_t frame_id, double x_mu, cv::Mat labels = {}) const {
    auto frame = std::make_shared<Frame>();
    frame->frame_id = frame_id;
    frame->camera = camera_;
    frame->has_masks = !labels.empty();
    frame->labels = labels;
    TrackedFrame tracked;
    tracked.frame = frame;
    tracked.reference = second_;
    tracked.T_reference_camera = {Eigen::Quaterniond::Identity(), {x_mu, 0, 0}};
    return tracked;
  }

  cv::Mat MaskUntil(int column_px) const {
    cv::Mat labels(camera_.height_px, camera_.width_px, CV_16UC1, cv::Scalar(0));
    labels.colRange(0, column_px).setTo(kLabel);
    return labels;
  }

  const MaskVotes& VotesFor(int i) const { return map_.FindPoint(points_[static_cast<size_t>(i)])->votes; }

  int InsideVotes() const {
    int inside = 0;
    for (int i = 0; i < kPoints; ++i) inside += VotesFor(i).inside;
    return inside;
  }

  const CameraModel camera_ = TexturedWorld().camera();
  SlamMap map_{SlamConfig{}};
  KeyframeId first_, second_;
  std::vector<MapPointId> points_;
  MaskVoter voter_{SlamConfig{}};
};

TEST_F(MaskVoterTest, LateMasksLabelTheFeaturesOfAKeyframe) {
  const std::shared_ptr<const FrameFeatures> before = map_.FindKeyframe(first_)->frame;
  voter_.ObserveMasks({.frame_id = 1, .labels = MaskUntil(90), .instances = {}}, map_);
  const FrameFeatures& after = *map_.FindKeyframe(first_)->frame;
  EXPECT_TRUE(after.has_masks);
  for (size_t i = 0; i < kPoints; ++i) {
    const bool inside = i < 4;  // pixels 20, 40, 60, 80
    EXPECT_EQ(after.features[i].label, inside ? kLabel : 0) << i;
    EXPECT_EQ(after.mask_zones[i] == MaskZone::kInside, inside) << i;
  }
  // The features are replaced, not modified, because other threads may still use the old ones.
  EXPECT_FALSE(before->has_masks);
  EXPECT_EQ(before->features[0].label, 0);
  EXPECT_FALSE(map_.FindKeyframe(second_)->frame->has_masks);
  // Repeated masks of the same frame are ignored.
  voter_.ObserveMasks({.frame_id = 1, .labels = MaskUntil(300), .instances = {}}, map_);
  EXPECT_EQ(map_.FindKeyframe(first_)->features()[10].label, 0);
}

TEST_F(MaskVoterTest, LateMasksOfOtherFramesCountAsVotes) {
  // The camera is 0.2 + 0.5 mu to the right of the first keyframe: all points move left by 0.7 / 5 * fx.
  const double shift_px = 0.7 / kDepth_mu * camera_.fx_px;
  voter_.ObserveFrame(FrameNearSecond(6, 0.5), map_);
  EXPECT_EQ(InsideVotes(), 0);
  voter_.ObserveMasks({.frame_id = 6, .labels = MaskUntil(130), .instances = {}}, map_);
  for (int i = 0; i < kPoints; ++i) {
    const double column_px = 20 + 20.0 * i - shift_px;
    if (column_px < 0) {
      EXPECT_EQ(VotesFor(i).total(), 0) << i << " is outside the image";
    } else if (std::abs(column_px - 130) > 4) {
      EXPECT_EQ(VotesFor(i).inside, column_px < 130 ? 1 : 0) << i;
      EXPECT_EQ(VotesFor(i).total(), 1) << i;
    }
  }
  const int before = InsideVotes();
  EXPECT_GT(before, 4);
  voter_.ObserveMasks({.frame_id = 6, .labels = MaskUntil(130), .instances = {}}, map_);
  EXPECT_EQ(InsideVotes(), before) << "masks count once";
}

TEST_F(MaskVoterTest, WaitingFramesMoveWithTheMap) {
  voter_.ObserveFrame(FrameNearSecond(6, 0.5), map_);
  voter_.ObserveMasks({.frame_id = 6, .labels = MaskUntil(130), .instances = {}}, map_);
  const int before = InsideVotes();
  voter_.ObserveFrame(FrameNearSecond(7, 0.5), map_);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  map_.Transform({3.0, turn, {1, -2, 0.5}});
  voter_.ObserveMasks({.frame_id = 7, .labels = MaskUntil(130), .instances = {}}, map_);
  EXPECT_EQ(InsideVotes(), 2 * before);
}

TEST_F(MaskVoterTest, ProjectsPointsWithLensDistortion) {
  map_.CorrectLens({-0.3});
  // The corrected features no longer match the points, so this tests the projection alone.
  voter_.ObserveFrame(FrameNearSecond(6, -0.2, MaskUntil(60)), map_);
  const Eigen::Vector2d image_px = map_.lens().Distort(camera_, {40, 120});
  ASSERT_GT(image_px.x(), 45);
  const double last_inside_px = map_.lens().Distort(camera_, {20, 120}).x();
  ASSERT_LT(last_inside_px, 55);
  EXPECT_EQ(VotesFor(0).inside, 1);
  EXPECT_EQ(VotesFor(3).inside, 0);  // pinhole pixel 80
}

TEST_F(MaskVoterTest, IgnoresFramesWhoseReferenceHasMasks) {
  voter_.ObserveFrame(FrameNearSecond(6, 0, MaskUntil(200)), map_);
  const int before = InsideVotes();
  EXPECT_GT(before, 4);
  voter_.ObserveMasks({.frame_id = 5, .labels = MaskUntil(200), .instances = {}}, map_);
  ASSERT_TRUE(map_.FindKeyframe(second_)->frame->has_masks);
  voter_.ObserveFrame(FrameNearSecond(7, 0, MaskUntil(200)), map_);
  EXPECT_EQ(InsideVotes(), before);
}

TEST_F(MaskVoterTest, IgnoresMasksOfUnknownFrames) {
  voter_.ObserveMasks({.frame_id = 3, .labels = MaskUntil(320), .instances = {}}, map_);
  voter_.ObserveMasks({.frame_id = 99, .labels = MaskUntil(320), .instances = {}}, map_);
  voter_.ObserveFrame(FrameNearSecond(6, 0), map_);
  voter_ = MaskVoter(SlamConfig{});
  voter_.ObserveMasks({.frame_id = 6, .labels = MaskUntil(320), .instances = {}}, map_);
  EXPECT_EQ(InsideVotes(), 0);
}

TEST_F(MaskVoterTest, MergedPointsKeepTheirVotes) {
  voter_.ObserveFrame(FrameNearSecond(6, 0, MaskUntil(320)), map_);
  ASSERT_EQ(VotesFor(3).inside, 1);
  PointTrack& same = map_.AddPoint(PointAt(3));
  map_.MergePoints(points_[3], same.point.id);
  EXPECT_EQ(same.votes.inside, 1);
}

}  // namespace romap::slam::mask_voter_test
