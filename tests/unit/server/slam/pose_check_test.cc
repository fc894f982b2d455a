#include "server/slam/pose_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "common/angles.h"
#include "tests/unit/server/slam/random_descriptor.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::pose_check_test {

using ::testing::HasSubstr;
using Pose = SE3<World, Camera>;

CameraModel Vga() {
  return {.width_px = 640, .height_px = 480, .fx_px = 560, .fy_px = 560, .cx_px = 319.5, .cy_px = 239.5};
}

// A room full of points; a share of them moves at random between frames, as moving objects do.
class PointRoom {
 public:
  explicit PointRoom(double moving_share = 0) : random_(7) {
    std::uniform_real_distribution<double> coordinate(-3, 3);
    for (int i = 0; i < 1500; ++i) {
      points_.push_back({coordinate(random_), coordinate(random_), coordinate(random_)});
      descriptors_.push_back(RandomDescriptor(random_));
    }
    moving_ = static_cast<size_t>(moving_share * static_cast<double>(points_.size()));
  }

  // Lets the moving points move to and fro together, by at most this step between two frames.
  void MoveTogether(const Eigen::Vector3d& step) { step_ = step; }

  std::shared_ptr<const FrameFeatures> See(uint64_t frame_id, const Pose& T_world_camera, double noise_px = 0) {
    std::normal_distribution<double> step(0, 0.2), noise(0, 1);
    for (size_t i = 0; i < moving_; ++i) {
      points_[i] += step_ ? Eigen::Vector3d(*step_ * std::cos(0.1 * static_cast<double>(frame_id)))
                          : Eigen::Vector3d(step(random_), step(random_), step(random_));
    }
    auto features = std::make_shared<FrameFeatures>();
    features->frame_id = frame_id;
    features->camera = Vga();
    const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d p_camera = T_camera_world * points_[i];
      if (p_camera.z() < 0.3) continue;
      const Eigen::Vector2d pixel_px =
          features->camera.Project(p_camera) + noise_px * Eigen::Vector2d(noise(random_), noise(random_));
      if (pixel_px.x() < 0 || pixel_px.y() < 0 || pixel_px.x() > 639 || pixel_px.y() > 479) continue;
      Feature feature;
      feature.pixel_px = pixel_px.cast<float>();
      feature.descriptor = Flip(descriptors_[i], static_cast<int>(random_() % 20));
      features->features.push_back(feature);
    }
    return features;
  }

 private:
  std::mt19937_64 random_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Descriptor> descriptors_;
  size_t moving_ = 0;
  std::optional<Eigen::Vector3d> step_;
};

// A hand-held camera that moves around the middle of the room, with frames at 25 Hz.
Pose HandPose(double t_s) {
  const double angle_rad = 0.5 * t_s;
  const Eigen::Vector3d eye(2.6 * std::cos(angle_rad), 2.6 * std::sin(angle_rad), 0.8 + 0.3 * std::sin(1.7 * t_s));
  const Pose level = TexturedWorld::LookAt(eye, {0.4 * std::sin(1.3 * t_s), 0.3 * std::cos(1.9 * t_s), 0});
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(0.15 * std::sin(2.3 * t_s), Eigen::Vector3d::UnitZ()));
  return {level.rotation() * roll, eye};
}

// The same with the camera in one place.
Pose RotationPose(double t_s) { return {HandPose(t_s).rotation(), Eigen::Vector3d(2, 0, 0.5)}; }

constexpr double kFrame_s = 0.04;
constexpr int kFrames = 240;

// Feeds every second frame, as if it were a keyframe. `give`: the given pose by the number of the frame.
template <class Path, class Give>
PoseCheck Feed(PointRoom& room, const Path& path, const Give& give, double noise_px = 0.5) {
  PoseCheck check{SlamConfig{}};
  for (int i = 0; i < kFrames; i += 2) {
    check.AddFrame(room.See(static_cast<uint64_t>(i + 1), path(kFrame_s * i), noise_px), give(i));
  }
  return check;
}

// Poses as a client reads them that does not apply a convention.
Pose GiveOpenGl(const Pose& pose) { return {pose.rotation() * Eigen::Quaterniond(0, 1, 0, 0), pose.translation()}; }
Pose GiveInverse(const Pose& pose) {
  const SE3<Camera, World> inverse = pose.Inverse();
  return {inverse.rotation(), inverse.translation()};
}
Pose GiveWFirst(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation();
  return {Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), pose.translation()};  // x y z w <- w x y z
}

template <class Convert>
Diagnostic Contradiction(const Convert& convert) {
  PointRoom room;
  const PoseCheck check = Feed(room, HandPose, [&](int i) { return convert(HandPose(kFrame_s * i)); });
  const auto diagnostic = check.Check();
  EXPECT_TRUE(diagnostic.has_value());
  return diagnostic.value_or(Diagnostic{});
}

TEST(PoseCheck, SoundPosesWithPixelNoiseAgree) {
  PointRoom room;
  const PoseCheck check = Feed(
      room, HandPose, [](int i) { return HandPose(kFrame_s * i); }, 1.5);
  EXPECT_FALSE(check.Check().has_value());
  ASSERT_GT(check.pairs().size(), 5u);
  for (const auto& pair : check.pairs()) EXPECT_TRUE(pair.agrees) << pair.given_share;
}

TEST(PoseCheck, MovingObjectsDoNotContradict) {
  PointRoom room(0.3);
  const PoseCheck check = Feed(
      room, HandPose, [](int i) { return HandPose(kFrame_s * i); }, 1);
  EXPECT_FALSE(check.Check().has_value());
}

TEST(PoseCheck, AnObjectThatHasMostOfTheMatchesDoesNotContradict) {
  PointRoom room(0.75);
  room.MoveTogether({0.05, 0.06, 0.1});
  const PoseCheck check = Feed(
      room, HandPose, [](int i) { return HandPose(kFrame_s * i); }, 1);
  EXPECT_FALSE(check.IsContradicted());
  EXPECT_TRUE(std::any_of(check.pairs().begin(), check.pairs().end(), [](const auto& pair) { return !pair.agrees; }));
}

TEST(PoseCheck, ASmallClockOffsetDoesNotContradict) {
  for (const double offset_s : {-0.02, 0.01, 0.02}) {
    PointRoom room;
    const PoseCheck check = Feed(room, HandPose, [&](int i) { return HandPose(kFrame_s * i + offset_s); });
    EXPECT_FALSE(check.Check().has_value()) << offset_s;
  }
}

TEST(PoseCheck, NoisyPosesDoNotContradict) {
  PointRoom room;
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.003);
  const auto vector = [&] { return Eigen::Vector3d(noise(random), noise(random), noise(random)); };
  const PoseCheck check = Feed(room, HandPose, [&](int i) {
    const Pose pose = HandPose(kFrame_s * i);
    const Eigen::Vector3d turn = vector();
    return Pose(pose.rotation() * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())),
                pose.translation() + vector());
  });
  EXPECT_FALSE(check.Check().has_value());
}

TEST(PoseCheck, SoundRotationsInPlaceAgree) {
  PointRoom room;
  const PoseCheck check = Feed(
      room, RotationPose, [](int i) { return RotationPose(kFrame_s * i); }, 1);
  EXPECT_FALSE(check.Check().has_value());
  for (const auto& pair : check.pairs()) EXPECT_TRUE(pair.agrees) << pair.given_share;
}

TEST(PoseCheck, RotationsInPlaceShowAWrongConvention) {
  PointRoom room;
  const PoseCheck check = Feed(room, RotationPose, [](int i) { return GiveOpenGl(RotationPose(kFrame_s * i)); });
  ASSERT_TRUE(check.Check().has_value());
  EXPECT_EQ(check.Check()->advice, "run with --pose-convention opengl");
}

TEST(PoseCheck, AStandingCameraGivesNoDecision) {
  PointRoom room(0.3);
  const PoseCheck check = Feed(
      room, [](double) { return HandPose(0); }, [](int) { return GiveInverse(HandPose(0)); });
  EXPECT_FALSE(check.Check().has_value());
  EXPECT_TRUE(check.pairs().empty());
}

TEST(PoseCheck, NamesOpenGlAxes) {
  const Diagnostic diagnostic = Contradiction(GiveOpenGl);
  EXPECT_EQ(diagnostic.code, "poses_contradict_images");
  EXPECT_EQ(diagnostic.severity, Severity::kError);
  EXPECT_THAT(diagnostic.text, HasSubstr("agree when the poses are taken with OpenGL camera axes"));
  EXPECT_EQ(diagnostic.advice, "run with --pose-convention opengl");
}

TEST(PoseCheck, NamesWorldToCamera) {
  EXPECT_EQ(Contradiction(GiveInverse).advice, "run with --pose-convention world_to_camera");
}

TEST(PoseCheck, NamesQuaternionsWithWFirst) {
  EXPECT_EQ(Contradiction(GiveWFirst).advice, "run with --pose-convention wxyz");
}

TEST(PoseCheck, NamesCombinedConventions) {
  const Diagnostic diagnostic = Contradiction([](const Pose& pose) { return GiveInverse(GiveOpenGl(pose)); });
  EXPECT_EQ(diagnostic.advice, "run with --pose-convention world_to_camera,opengl");
}

std::shared_ptr<const FrameFeatures> Flipped(const FrameFeatures& features, bool left_right, bool top_bottom) {
  auto flipped = std::make_shared<FrameFeatures>(features);
  for (Feature& feature : flipped->features) {
    if (left_right) feature.pixel_px.x() = 639 - feature.pixel_px.x();
    if (top_bottom) feature.pixel_px.y() = 479 - feature.pixel_px.y();
  }
  return flipped;
}

std::string TextOfFlippedImages(bool left_right, bool top_bottom) {
  PointRoom room;
  PoseCheck check{SlamConfig{}};
  for (int i = 0; i < kFrames; i += 2) {
    const Pose pose = HandPose(kFrame_s * i);
    check.AddFrame(Flipped(*room.See(static_cast<uint64_t>(i + 1), pose, 0.5), left_right, top_bottom), pose);
  }
  const auto diagnostic = check.Check();
  EXPECT_TRUE(diagnostic.has_value());
  return diagnostic ? diagnostic->text + ": " + diagnostic->advice : "";
}

TEST(PoseCheck, NamesFlippedImages) {
  EXPECT_THAT(TextOfFlippedImages(true, false), HasSubstr("agree when the images are taken as mirrored left to right"));
  EXPECT_THAT(TextOfFlippedImages(false, true), HasSubstr("as mirrored top to bottom"));
  EXPECT_THAT(TextOfFlippedImages(true, true), HasSubstr("as turned by 180 degrees"));
  EXPECT_THAT(TextOfFlippedImages(true, false), HasSubstr("send the images and masks as the camera took them"));
}

TEST(PoseCheck, NamesTheRotationOfTheCameraOnABody) {
  const Eigen::Quaterniond R_body_camera(0.5, -0.5, 0.5, -0.5);  // x forward, y left, z up
  const Diagnostic diagnostic = Contradiction(
      [&](const Pose& pose) { return Pose(pose.rotation() * R_body_camera.conjugate(), pose.translation()); });
  EXPECT_THAT(diagnostic.text, HasSubstr("constant rotation on the body"));
  EXPECT_THAT(diagnostic.advice, HasSubstr("--pose-offset \"tx ty tz -0.5"));
}

TEST(PoseCheck, DoesNotGuessWhatPosesOfAnotherPathMean) {
  const Diagnostic diagnostic = Contradiction([](const Pose& pose) {
    const double t_s = 40 + 3 * pose.translation().x();
    return HandPose(-1.4 * t_s);
  });
  EXPECT_EQ(diagnostic.code, "poses_contradict_images");
  EXPECT_THAT(diagnostic.advice, HasSubstr("clock of the poses"));
}

TEST(PoseCheck, ContradictionStartsWithTheFirstWrongFrame) {
  PointRoom room;
  const PoseCheck check = Feed(room, HandPose, [](int i) {
    const Pose pose = HandPose(kFrame_s * i);
    return i < 80 ? pose : GiveOpenGl(pose);
  });
  ASSERT_TRUE(check.IsContradicted());
  EXPECT_GE(check.contradicted_since_frame(), 60u);
}

TEST(PoseCheck, OneJumpOfThePosesDoesNotContradict) {
  PointRoom room;
  const Pose T_new_old(Eigen::Quaterniond(0.6, 0, 0, 0.8), {5, 0, 0});
  const PoseCheck check = Feed(room, HandPose, [&](int i) {
    const Pose pose = HandPose(kFrame_s * i);
    return i < 80 ? pose : Pose(T_new_old.rotation() * pose.rotation(), T_new_old.rotation() * pose.translation());
  });
  EXPECT_FALSE(check.IsContradicted());
}

TEST(PoseCheck, PosesThatStandStillWhileTheImageMovesAreContradicted) {
  PointRoom room;
  const PoseCheck check = Feed(room, HandPose, [](int) { return HandPose(0); });
  EXPECT_TRUE(check.IsContradicted());
}

}  // namespace romap::slam::pose_check_test
