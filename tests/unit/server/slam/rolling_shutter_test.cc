#include "server/slam/rolling_shutter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "server/slam/optimize/lie.h"
#include "tests/unit/server/slam/tracking_fixture.h"

namespace romap::slam::rolling_shutter_test {

const CameraModel kCamera{
    .width_px = 320, .height_px = 240, .fx_px = 290, .fy_px = 290, .cx_px = 159.5, .cy_px = 119.5};
const ReadoutMotion kMotion{.rotation_rad = {0.02, -0.03, 0.01}, .translation_mu = {0.02, 0.01, -0.03}, .depth_mu = 2};

// A point in the camera frame of the middle row, in that of the time `s` (share of the readout).
Eigen::Vector3d AtTime(const Eigen::Vector3d& p_middle, double s) {
  return ExpRotation(-s * kMotion.rotation_rad) * (p_middle - s * kMotion.translation_mu);
}

// The pixel that shows the point in the image of the rolling shutter, by bisection over the rows.
Eigen::Vector2d RollingPixel(const Eigen::Vector3d& p_middle) {
  const auto row_at = [&](double s) { return kCamera.Project(AtTime(p_middle, s)).y(); };
  double before = -0.5, after = 0.5;
  for (int i = 0; i < 50; ++i) {
    const double s = 0.5 * (before + after);
    const double read_row = (s + 0.5) * (kCamera.height_px - 1);
    (row_at(s) > read_row ? before : after) = s;
  }
  return kCamera.Project(AtTime(p_middle, before));
}

Frame GlobalFrame() {
  Frame frame;
  frame.camera = kCamera;
  frame.source_camera = kCamera;
  return frame;
}

TEST(RollingShutterTest, PixelsOfPointsAreThoseOfTheMiddleRow) {
  const RollingShutter shutter(GlobalFrame(), kMotion);
  double largest_move_px = 0;
  for (const double depth_mu : {0.7, 2.0, 5.0}) {
    for (const double u : {10.0, 150.0, 310.0}) {
      for (const double v : {12.0, 60.0, 119.5, 225.0}) {
        const Eigen::Vector2d global_px(u, v);
        const Eigen::Vector2d rolling_px = RollingPixel(depth_mu * kCamera.Unproject(u, v));
        EXPECT_LT((shutter.ToRolling(global_px, depth_mu) - rolling_px).norm(), 2e-3) << u << " " << v;
        // The depth at the row's own time differs slightly.
        EXPECT_LT((shutter.ToGlobal(rolling_px, depth_mu) - global_px).norm(), 0.2) << u << " " << v;
        largest_move_px = std::max(largest_move_px, (rolling_px - global_px).norm());
      }
    }
  }
  EXPECT_GT(largest_move_px, 5);
}

TEST(RollingShutterTest, UnknownDepthIsThatOfTheScene) {
  const RollingShutter shutter(GlobalFrame(), kMotion);
  EXPECT_EQ(shutter.ToGlobal(Eigen::Vector2d(20, 20), 0), shutter.ToGlobal(Eigen::Vector2d(20, 20), kMotion.depth_mu));
  ReadoutMotion unknown = kMotion;
  unknown.depth_mu = 0;
  ReadoutMotion rotation_only = kMotion;
  rotation_only.translation_mu.setZero();
  EXPECT_EQ(RollingShutter(GlobalFrame(), unknown).ToGlobal(Eigen::Vector2d(20, 20), 0),
            RollingShutter(GlobalFrame(), rotation_only).ToGlobal(Eigen::Vector2d(20, 20), 0));
}

// Rows of a distorted image are not those of its pinhole image.
TEST(RollingShutterTest, RowsAreThoseOfTheDistortedImage) {
  Frame frame = GlobalFrame();
  frame.source_camera.distortion = {-0.3, 0, 0, 0, 0};
  const ReadoutMotion turn{.rotation_rad = {0, 0.05, 0}};
  const Eigen::Vector2d corner_px(5, 5);
  const double by_pinhole_px = (RollingShutter(GlobalFrame(), turn).ToGlobal(corner_px, 0) - corner_px).norm();
  const double by_lens_px = (RollingShutter(frame, turn).ToGlobal(corner_px, 0) - corner_px).norm();
  EXPECT_LT(by_lens_px, 0.97 * by_pinhole_px);
}

// Frames of TexturedWorld with a rolling shutter: bands of rows, each with its own pose.
class RollingShutterTrackingTest : public TrackingTest {
 protected:
  static constexpr double kReadout = 0.8;  // of the frame interval
  static constexpr double kInterval_s = 0.033;

  // A path that turns by up to 1.5 degrees per frame in all directions.
  static SE3<World, Camera> PoseAt(double i) {
    const double angle_rad = 0.02 * i;
    const SE3<World, Camera> arc = TexturedWorld::LookAt(
        {1.5 * std::cos(angle_rad), 1.5 * std::sin(angle_rad), 1.3 + 0.1 * std::sin(0.1 * i)}, {0, 0, 0.1});
    const Eigen::Vector3d turn_rad(0.08 * std::sin(0.25 * i), 0.1 * std::sin(0.2 * i + 1), 0.06 * std::sin(0.3 * i));
    return arc * SE3<Camera, Camera>(ExpRotation(turn_rad), Eigen::Vector3d::Zero());
  }

  std::shared_ptr<Frame> RenderRolling(int i, double readout_s) const {
    constexpr int kBands = 18;
    std::shared_ptr<Frame> frame = world_.Render(static_cast<uint64_t>(i + 1), PoseAt(i));
    const int rows = frame->image_bgr.rows / kBands;
    for (int band = 0; band < kBands; ++band) {
      const double s = (band + 0.5) / kBands - 0.5;
      const auto at_band = world_.Render(static_cast<uint64_t>(i + 1), PoseAt(i + kReadout * s));
      const cv::Range range(band * rows, (band + 1) * rows);
      at_band->image_bgr.rowRange(range).copyTo(frame->image_bgr.rowRange(range));
      at_band->labels.rowRange(range).copyTo(frame->labels.rowRange(range));
    }
    frame->camera.readout_s = readout_s;
    return frame;
  }

  struct Outcome {
    double worst = 0;         // largest error of a camera position, as a share of the radius of the path
    double mask_px = 0;       // share of the pixels of the last mask that differ from the true one
    double late_mask_px = 0;  // the same for late masks
  };

  static double MaskDifference(const cv::Mat& labels, const cv::Mat& truth) {
    const cv::Mat inside = labels > 0, truly_inside = truth > 0;
    return cv::countNonZero(inside != truly_inside) / static_cast<double>(cv::countNonZero(truly_inside));
  }

  Outcome Run(double readout_s) {
    constexpr int kFrames = 45;
    Restart(PoseUse::kIgnore);
    Outcome outcome;
    for (int i = 0; i < kFrames; ++i) {
      const auto frame = RenderRolling(i, readout_s);
      const auto truth = world_.Render(static_cast<uint64_t>(i + 1), PoseAt(i));
      const bool is_late = i == kFrames - 2;
      const FrameMasks masks = is_late ? TakeMasks(*frame) : FrameMasks{};
      ProcessFrame(frame);
      if (is_late) outcome.late_mask_px = MaskDifference(tracker_->ConvertMasks(masks).labels, truth->labels);
      if (i == kFrames - 1) outcome.mask_px = MaskDifference(image_.tracked.frame->labels, truth->labels);
    }
    EXPECT_GT(frames_.size(), 35U);
    outcome.worst = Error().first / 1.5;
    return outcome;
  }
};

TEST_F(RollingShutterTrackingTest, KnownReadoutTimeRemovesTheDistortion) {
  const Outcome ignored = Run(0);
  const Outcome known = Run(kReadout * kInterval_s);
  EXPECT_LT(known.worst, 0.6 * ignored.worst) << ignored.worst;
  EXPECT_LT(known.mask_px, 0.75 * ignored.mask_px) << ignored.mask_px;
  EXPECT_LT(known.late_mask_px, 0.75 * ignored.late_mask_px) << ignored.late_mask_px;
}

TEST_F(RollingShutterTrackingTest, AGlobalShutterContradictsAReadoutTime) {
  for (const double stated_s : {0.0, kReadout * kInterval_s}) {
    Restart(PoseUse::kIgnore);
    for (int i = 0; i < 110; ++i) {
      const auto frame = world_.Render(static_cast<uint64_t>(i + 1), PoseAt(i));
      frame->camera.readout_s = stated_s;
      ProcessFrame(frame);
    }
    EXPECT_EQ(HasWarning("readout_time"), stated_s > 0);
  }
}

// With given poses, keyframes and masks are those of a global shutter too.
TEST_F(RollingShutterTrackingTest, GivenPosesDetermineTheMotion) {
  double differences[2] = {};
  for (const bool is_known : {false, true}) {
    Restart(PoseUse::kGiven);
    for (int i = 0; i < 10; ++i) ProcessFrame(RenderRolling(i, is_known ? kReadout * kInterval_s : 0));
    differences[is_known ? 1 : 0] = MaskDifference(image_.tracked.frame->labels, world_.Render(10, PoseAt(9))->labels);
  }
  EXPECT_LT(differences[1], 0.75 * differences[0]);
}

}  // namespace romap::slam::rolling_shutter_test
