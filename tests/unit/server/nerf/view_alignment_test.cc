#include "server/nerf/view_alignment.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::nerf::view_alignment_test {

constexpr double kFocal_px = 500, kDistance_mu = 2;

// A smooth pattern on a plane facing the camera; the object is an ellipse in it.
struct TestImage {
  Eigen::Vector2d center_px{330, 250};
  bool textured = true;

  bool Contains(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d q = (p - center_px).cwiseQuotient(Eigen::Vector2d(40, 28));
    return q.squaredNorm() < 1;
  }
  std::array<float, 3> Bgr(const Eigen::Vector2d& p) const {
    if (!textured) return {0.5f, 0.5f, 0.5f};
    const auto wave = [&](double x, double y) {
      return static_cast<float>(0.5 + 0.3 * std::sin(x * p.x() + y * p.y()));
    };
    return {wave(0.3, 0.1), wave(-0.1, 0.25), wave(0.2, -0.2)};
  }

  ObjectView View() const {
    ObjectView view;
    view.camera.width_px = 640;
    view.camera.height_px = 480;
    view.camera.fx_px = view.camera.fy_px = kFocal_px;
    view.camera.cx_px = 319.5;
    view.camera.cy_px = 239.5;
    view.roi_px = {270, 200, 120, 100};
    view.color_bgr = cv::Mat(view.roi_px.size(), CV_8UC3);
    view.ray_kind = cv::Mat(view.roi_px.size(), CV_8UC1);
    for (int y = 0; y < view.roi_px.height; ++y) {
      for (int x = 0; x < view.roi_px.width; ++x) {
        const Eigen::Vector2d p(x + view.roi_px.x, y + view.roi_px.y);
        const auto bgr = Bgr(p);
        for (int c = 0; c < 3; ++c) {
          view.color_bgr.at<cv::Vec3b>(y, x)[c] = static_cast<uint8_t>(std::lround(255 * bgr[static_cast<size_t>(c)]));
        }
        view.ray_kind.at<uint8_t>(y, x) = static_cast<uint8_t>(Contains(p) ? RayKind::kObject : RayKind::kBackground);
      }
    }
    return view;
  }

  SE3<Camera, Object> Pose(const ObjectView& view) const {
    return {Eigen::Quaterniond::Identity(), kDistance_mu * view.camera.Unproject(center_px.x(), center_px.y())};
  }
};

// A rendering that matches the view after a motion by `shift_px` and a rotation by `roll_rad` about the center.
std::vector<RenderedPixel> Render(const TestImage& image, const ObjectView& view, const Eigen::Vector2d& shift_px,
                                  double roll_rad = 0, float brighter = 0, size_t pixels = 150) {
  std::vector<RenderedPixel> rendered;
  for (const cv::Point& at : ViewAlignment(view).Pixels(pixels, 3)) {
    const Eigen::Vector2d arm = Eigen::Vector2d(at.x, at.y) - image.center_px;
    const Eigen::Vector2d source = image.center_px + Eigen::Rotation2Dd(roll_rad) * arm + shift_px;
    RenderedPixel pixel{at.x, at.y, kDistance_mu * view.camera.Unproject(at.x, at.y), image.Bgr(source),
                        image.Contains(source) ? 1.0f : 0.0f};
    for (float& channel : pixel.bgr) channel += brighter;
    rendered.push_back(pixel);
  }
  return rendered;
}

Eigen::Vector2d Shift_px(const ObjectMotion& motion) { return motion.segment<2>(3) * kFocal_px / kDistance_mu; }

TEST(ViewAlignmentTest, MotionBetweenInvertsMoved) {
  const SE3<Camera, Object> T(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())),
                              {0.1, -0.2, 2});
  ObjectMotion motion;
  motion << 0.02, -0.01, 0.03, 0.1, 0.2, -0.1;
  const SE3<Camera, Object> T_moved = Moved(T, motion);
  EXPECT_TRUE(MotionBetween(T, T_moved).isApprox(motion, 1e-9));
  EXPECT_TRUE(MotionBetween(T, T).isZero(1e-9));
  EXPECT_TRUE((T_moved * Eigen::Vector3d::Zero()).isApprox(Eigen::Vector3d(0.2, 0, 1.9), 1e-9)) << "about its center";
}

TEST(ViewAlignmentTest, FindsAGivenShiftAndRoll) {
  const TestImage image;
  const ObjectView view = image.View();
  const ViewAlignment alignment(view);
  for (const Eigen::Vector2d& shift_px :
       {Eigen::Vector2d(2, 0), Eigen::Vector2d(-1, 1.5), Eigen::Vector2d(0.4, -0.3)}) {
    const ObjectMotion motion =
        alignment.Align(Render(image, view, shift_px), image.Pose(view), ObjectMotion::Zero(), 8);
    EXPECT_LT((Shift_px(motion) - shift_px).norm(), 0.1 + 0.1 * shift_px.norm()) << Shift_px(motion).transpose();
  }
  const ObjectMotion rolled =
      alignment.Align(Render(image, view, {0, 0}, 0.02), image.Pose(view), ObjectMotion::Zero(), 8);
  EXPECT_NEAR(rolled[2], 0.02, 0.006);
  EXPECT_LT(Shift_px(rolled).norm(), 0.1);
}

TEST(ViewAlignmentTest, FindsShiftsFromTheOutlineAlone) {
  TestImage image;
  image.textured = false;
  const ObjectView view = image.View();
  const ObjectMotion motion =
      ViewAlignment(view).Align(Render(image, view, {-1.5, 1}, 0, 0, 2000), image.Pose(view), ObjectMotion::Zero(), 8);
  EXPECT_LT((Shift_px(motion) - Eigen::Vector2d(-1.5, 1)).norm(), 0.6) << Shift_px(motion).transpose();
}

TEST(ViewAlignmentTest, KeepsACorrectPoseUnderOtherLighting) {
  const TestImage image;
  const ObjectView view = image.View();
  for (const float brighter : {0.0f, 0.15f}) {
    const ObjectMotion motion =
        ViewAlignment(view).Align(Render(image, view, {0, 0}, 0, brighter), image.Pose(view), ObjectMotion::Zero(), 8);
    EXPECT_LT(Shift_px(motion).norm(), 0.05);
  }
}

TEST(ViewAlignmentTest, IgnoresTheOutlineOfAnOccluder) {
  TestImage image;
  image.textured = false;
  ObjectView view = image.View();
  const std::vector<RenderedPixel> whole = Render(image, view, {0, 0});
  view.ray_kind.colRange(0, 50).setTo(static_cast<int>(RayKind::kOccluder));
  const ObjectMotion motion = ViewAlignment(view).Align(whole, image.Pose(view), ObjectMotion::Zero(), 8);
  EXPECT_LT(Shift_px(motion).norm(), 0.1);
}

TEST(ViewAlignmentTest, WithoutEvidenceReturnsToTheGivenPose) {
  TestImage image;
  image.textured = false;
  ObjectView view = image.View();
  view.ray_kind.setTo(static_cast<int>(RayKind::kObject));
  std::vector<RenderedPixel> rendered;
  for (const cv::Point& at : ViewAlignment(view).Pixels(100, 1)) {
    rendered.push_back({at.x, at.y, kDistance_mu * view.camera.Unproject(at.x, at.y), {0.5f, 0.5f, 0.5f}, 1.0f});
  }
  ObjectMotion applied = ObjectMotion::Zero();
  applied[3] = 0.01;
  const ObjectMotion motion = ViewAlignment(view).Align(rendered, image.Pose(view), applied, 2);
  EXPECT_TRUE(motion.isApprox(-applied, 1e-6)) << motion.transpose();
  EXPECT_TRUE(ViewAlignment(view).Align({}, image.Pose(view), applied, 2).isZero()) << "no rendering";
}

}  // namespace romap::nerf::view_alignment_test
