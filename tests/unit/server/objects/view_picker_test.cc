#include "server/objects/view_picker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "common/angles.h"
#include "server/objects/projection.h"

namespace romap::objects::view_picker_test {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr uint16_t kLabel = 3;

// A cube with sides of 0.2 map units at the origin, and cameras that orbit it at a distance of one map unit.
class ViewPickerTest : public ::testing::Test {
 protected:
  ViewPickerTest() {
    cuboid_.half_extents.setConstant(0.1);
    for (int i = 0; i < 27; ++i) {
      body_world_.emplace_back(0.05 * (i % 3 - 1), 0.05 * (i / 3 % 3 - 1), 0.05 * (i / 9 - 1));
    }
  }

  // A keyframe from this direction with an exact mask of the cube's bounding box.
  ViewCandidate MakeCandidate(double azimuth_deg, double distance_mu = 1) {
    const double a = azimuth_deg * kRadPerDeg;
    Eigen::Matrix3d R_world_camera;
    R_world_camera.col(2) = -Eigen::Vector3d(std::cos(a), std::sin(a), 0);
    R_world_camera.col(1) = -Eigen::Vector3d::UnitZ();
    R_world_camera.col(0) = R_world_camera.col(1).cross(R_world_camera.col(2));
    auto frame = std::make_shared<Frame>();
    frame->camera = {.width_px = 320, .height_px = 240, .fx_px = 300, .fy_px = 300, .cx_px = 160, .cy_px = 120};
    frame->image_bgr = cv::Mat(240, 320, CV_8UC3);
    cv::randu(frame->image_bgr, cv::Scalar::all(0), cv::Scalar::all(255));
    frame->labels = cv::Mat::zeros(240, 320, CV_16UC1);
    ViewCandidate candidate;
    candidate.keyframe = KeyframeId{++last_keyframe_};
    candidate.T_world_camera = {R_world_camera, -distance_mu * R_world_camera.col(2)};
    candidate.label = kLabel;
    candidate.box_px = ProjectCuboid(cuboid_, 1, frame->camera, candidate.T_world_camera);
    candidate.detected = {1};
    candidate.detected_labels = {kLabel};
    frame->labels(candidate.box_px).setTo(kLabel);
    candidate.frame = frame;
    return candidate;
  }

  ViewContext Context() {
    return {.object = ObjectId{9},
            .cuboid = cuboid_,
            .body_world = body_world_,
            .object_points = {},
            .registry = &registry_,
            .neighbors = neighbors_};
  }

  // Offers one candidate and picks.
  std::vector<ObjectView> Pick(ViewCandidate candidate) {
    picker_.Offer(std::move(candidate));
    return picker_.Take(Context());
  }

  ObjectsConfig config_{.view_angle_deg = 20, .first_views = 0, .max_views = 4};
  ViewPicker picker_{config_};
  Cuboid cuboid_;
  std::vector<Eigen::Vector3d> body_world_;
  std::vector<ViewContext::Neighbor> neighbors_;
  PointRegistry registry_;
  uint64_t last_keyframe_ = 0;
};

TEST_F(ViewPickerTest, PicksNewDirectionsAndDistances) {
  EXPECT_THAT(Pick(MakeCandidate(0)), SizeIs(1));
  EXPECT_THAT(Pick(MakeCandidate(15)), IsEmpty());
  EXPECT_THAT(Pick(MakeCandidate(25)), SizeIs(1));
  EXPECT_THAT(Pick(MakeCandidate(-15)), IsEmpty());
  EXPECT_THAT(Pick(MakeCandidate(-15, 2)), SizeIs(1)) << "from twice the distance a smaller angle suffices";
}

TEST_F(ViewPickerTest, StopsAtTheMaximumNumberOfViews) {
  for (int i = 0; i < 4; ++i) EXPECT_THAT(Pick(MakeCandidate(30 * i)), SizeIs(1)) << i;
  EXPECT_THAT(Pick(MakeCandidate(180)), IsEmpty());
}

TEST_F(ViewPickerTest, TheCropContainsTheMaskAndClassifiesRays) {
  const ViewCandidate candidate = MakeCandidate(0);
  const std::vector<ObjectView> views = Pick(candidate);
  ASSERT_THAT(views, SizeIs(1));
  EXPECT_EQ(views[0].object, ObjectId{9});
  EXPECT_EQ(views[0].roi_px & candidate.box_px, candidate.box_px);
  EXPECT_EQ(cv::countNonZero(views[0].ray_kind == static_cast<int>(RayKind::kObject)), candidate.box_px.area());
  EXPECT_EQ(cv::countNonZero(views[0].ray_kind == static_cast<int>(RayKind::kOccluder)), 0);
}

TEST_F(ViewPickerTest, RejectsAMaskThatMissesTheBody) {
  ViewCandidate candidate = MakeCandidate(0);
  cv::Mat labels = candidate.frame->labels;
  labels.setTo(0);
  labels(candidate.box_px & cv::Rect(0, 0, 160, 240)).setTo(kLabel);
  EXPECT_THAT(Pick(candidate), IsEmpty());
}

TEST_F(ViewPickerTest, RejectsAMaskBeyondTheCuboid) {
  ViewCandidate candidate = MakeCandidate(0);
  candidate.box_px =
      cv::Rect(candidate.box_px.x, candidate.box_px.y, 2 * candidate.box_px.width, candidate.box_px.height);
  candidate.frame->labels(candidate.box_px).setTo(kLabel);
  EXPECT_THAT(Pick(candidate), IsEmpty());
}

TEST_F(ViewPickerTest, PrefersSharpViewsUntilTheGapIsLarge) {
  const auto blurred = [&](double azimuth_deg) {
    ViewCandidate candidate = MakeCandidate(azimuth_deg);
    auto frame = std::make_shared<Frame>(*candidate.frame);
    cv::GaussianBlur(candidate.frame->image_bgr, frame->image_bgr, {0, 0}, 3);
    candidate.frame = frame;
    return candidate;
  };
  EXPECT_THAT(Pick(MakeCandidate(0)), SizeIs(1));
  EXPECT_THAT(Pick(MakeCandidate(25)), SizeIs(1));
  EXPECT_THAT(Pick(blurred(50)), IsEmpty());
  EXPECT_THAT(Pick(blurred(60)), SizeIs(1)) << "35 degrees from the nearest view";
}

TEST_F(ViewPickerTest, AMissedNeighborInFrontIsAnOccluder) {
  neighbors_.push_back({2, Cuboid{.T_world_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.4, 0.15, 0)},
                                  .half_extents = Eigen::Vector3d::Constant(0.05)}});
  const auto occluders = [](const ObjectView& view) {
    return cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kOccluder));
  };
  const std::vector<ObjectView> missed = Pick(MakeCandidate(0));
  ASSERT_THAT(missed, SizeIs(1));
  EXPECT_GT(occluders(missed[0]), 0);
  const std::vector<ObjectView> behind = Pick(MakeCandidate(180));
  ASSERT_THAT(behind, SizeIs(1));
  EXPECT_EQ(occluders(behind[0]), 0) << "behind the object it hides nothing";
}

TEST_F(ViewPickerTest, AdoptsOnlyNewDirections) {
  Pick(MakeCandidate(0));
  ViewPicker other(config_);
  other.Offer(MakeCandidate(5));
  other.Offer(MakeCandidate(90));
  ASSERT_THAT(other.Take(Context()), SizeIs(2));
  const std::vector<ObjectView> adopted = picker_.Adopt(std::move(other), ObjectId{4}, Eigen::Vector3d::Zero());
  ASSERT_THAT(adopted, SizeIs(1));
  EXPECT_EQ(adopted[0].object, ObjectId{4});
  EXPECT_THAT(Pick(MakeCandidate(95)), IsEmpty());
}

TEST_F(ViewPickerTest, ReturnsACorrectedPoseOnceItChangedNoticeably) {
  const std::vector<ObjectView> views = Pick(MakeCandidate(0));
  ASSERT_THAT(views, SizeIs(1));
  const auto corrected_by = [&](double shift_mu) {
    SE3<World, Camera> T = views[0].T_world_camera;
    T = {T.rotation(), T.translation() + Eigen::Vector3d(0, shift_mu, 0)};
    return KeyframeCorrections{{views[0].keyframe, {.id = views[0].keyframe, .T_world_camera = T, .S_new_old = {}}}};
  };
  picker_.Correct({}, corrected_by(0.0005));  // 0.15 px
  EXPECT_THAT(picker_.TakeCorrectedPoses(cuboid_), IsEmpty());
  picker_.Correct({}, corrected_by(0.01));
  EXPECT_THAT(picker_.TakeCorrectedPoses(cuboid_), SizeIs(1));
  EXPECT_THAT(picker_.TakeCorrectedPoses(cuboid_), IsEmpty());
}

}  // namespace romap::objects::view_picker_test
