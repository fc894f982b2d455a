#include "server/slam/focal_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "common/angles.h"
#include "server/slam/optimize/lie.h"
#include "tests/unit/server/slam/random_descriptor.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::focal_check_test {

using ::testing::HasSubstr;

constexpr double kTrueFocal_px = 525;

CameraModel CameraWith(double focal_px) {
  return {.width_px = 640, .height_px = 480, .fx_px = focal_px, .fy_px = focal_px, .cx_px = 319.5, .cy_px = 239.5};
}

// Points on and around a table in the middle of an orbit.
class Table {
 public:
  Table() : random_(11) {
    std::uniform_real_distribution<double> side(-0.6, 0.6), height(0, 0.3);
    for (int i = 0; i < 400; ++i) {
      points_.push_back({side(random_), side(random_), height(random_)});
      descriptors_.push_back(RandomDescriptor(random_));
    }
  }

  // The image of a camera with the true focal length; the frame states another one.
  std::shared_ptr<const FrameFeatures> See(uint64_t frame_id, const SE3<World, Camera>& T_world_camera,
                                           double stated_focal_px) {
    std::normal_distribution<double> noise(0, 0.7);
    auto frame = std::make_shared<FrameFeatures>();
    frame->frame_id = frame_id;
    frame->camera = CameraWith(stated_focal_px);
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector2d pixel_px = CameraWith(kTrueFocal_px).Project(T_world_camera.Inverse() * points_[i]) +
                                       Eigen::Vector2d(noise(random_), noise(random_));
      if (pixel_px.x() < 0 || pixel_px.y() < 0 || pixel_px.x() > 639 || pixel_px.y() > 479) continue;
      Feature feature;
      feature.pixel_px = pixel_px.cast<float>();
      feature.descriptor = Flip(descriptors_[i], static_cast<int>(random_() % 20));
      frame->features.push_back(feature);
    }
    return frame;
  }

 private:
  std::mt19937_64 random_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Descriptor> descriptors_;
};

struct Errors {
  double rotation_rad = 0;  // standard deviations per axis
  double position_m = 0;
};

// An orbit of `frames` frames, 2 degrees apart, with poses that have random errors.
std::optional<Diagnostic> CheckOrbit(double stated_focal_px, int frames = 90, const Errors& errors = {}) {
  Table table;
  FocalCheck check{SlamConfig{}};
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, 1);
  const auto random_vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < frames; ++i) {
    const double angle_rad = 2 * kRadPerDeg * i;
    const SE3<World, Camera> pose =
        TexturedWorld::LookAt({1.2 * std::cos(angle_rad), 1.2 * std::sin(angle_rad), 0.9}, {0, 0, 0.1});
    const SE3<World, Camera> given(pose.rotation() * ExpRotation(errors.rotation_rad * random_vector()),
                                   pose.translation() + errors.position_m * random_vector());
    check.AddFrame(table.See(static_cast<uint64_t>(i + 1), pose, stated_focal_px), given);
  }
  return check.Check();
}

TEST(FocalCheckTest, TheRightFocalLengthFits) { EXPECT_FALSE(CheckOrbit(kTrueFocal_px).has_value()); }

TEST(FocalCheckTest, ALongerFocalLengthOnAnOrbitIsFound) {
  const auto diagnostic = CheckOrbit(1.5 * kTrueFocal_px);
  ASSERT_TRUE(diagnostic.has_value());
  EXPECT_EQ(diagnostic->code, "focal_length_inexact");
  EXPECT_EQ(diagnostic->severity, Severity::kWarning);
  EXPECT_EQ(diagnostic->first_frame_id, 1u);
  EXPECT_THAT(diagnostic->text, ::testing::ContainsRegex("about 0\\.6[5-9] times"));
}

TEST(FocalCheckTest, AShorterFocalLengthOnAnOrbitIsFound) {
  const auto diagnostic = CheckOrbit(0.8 * kTrueFocal_px);
  ASSERT_TRUE(diagnostic.has_value());
  EXPECT_THAT(diagnostic->text, HasSubstr("about 1.24 times"));
}

TEST(FocalCheckTest, InexactPosesDoNotPreferAnotherFocalLength) {
  EXPECT_FALSE(CheckOrbit(kTrueFocal_px, 180, {.rotation_rad = 0.008, .position_m = 0.01}).has_value());
}

TEST(FocalCheckTest, AFewFramesAreNotJudged) {
  EXPECT_FALSE(CheckOrbit(1.5 * kTrueFocal_px, /*frames=*/8).has_value());
}

}  // namespace romap::slam::focal_check_test
