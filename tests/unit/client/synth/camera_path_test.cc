#include "client/synth/camera_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "client/synth/scene.h"
#include "client/synth/synth_camera.h"
#include "common/angles.h"

namespace romap::synth::camera_path_test {

std::vector<SE3<World, Camera>> Poses(const SynthOptions& options, const Scene& scene) {
  const CameraPath path(options, scene, SynthCamera(options));
  std::vector<SE3<World, Camera>> poses;
  for (int i = 0; i < options.frames; ++i) poses.push_back(path.Pose(i));
  return poses;
}

double Azimuth(const SE3<World, Camera>& pose) { return std::atan2(pose.translation().y(), pose.translation().x()); }

// Sum of the signed changes of azimuth [deg].
double TotalAzimuth_deg(const std::vector<SE3<World, Camera>>& poses) {
  double sum = 0;
  for (size_t i = 1; i < poses.size(); ++i) {
    sum += std::remainder(Azimuth(poses[i]) - Azimuth(poses[i - 1]), 2 * M_PI);
  }
  return sum / kRadPerDeg;
}

// The largest rotation [deg] and translation [mm] between consecutive frames from `first` to `last` - 1.
struct PeakMotion {
  double rotation_deg = 0;
  double translation_mm = 0;
};

PeakMotion FindPeakMotion(const std::vector<SE3<World, Camera>>& poses, size_t first, size_t last) {
  PeakMotion peak;
  for (size_t i = first + 1; i < last; ++i) {
    peak.rotation_deg =
        std::max(peak.rotation_deg, poses[i].rotation().angularDistance(poses[i - 1].rotation()) / kRadPerDeg);
    peak.translation_mm =
        std::max(peak.translation_mm, 1000 * (poses[i].translation() - poses[i - 1].translation()).norm());
  }
  return peak;
}

TEST(CameraPathTest, OrbitHasTheGivenElevationAndFacesTheTable) {
  const Scene scene = MakeScene({.seed = 2, .objects = 3});
  SynthOptions options{.seed = 2, .objects = 3, .frames = 36, .elevation_deg = 30};
  const CameraModel camera = SynthCamera(options);
  const auto path = Poses(options, scene);
  ASSERT_EQ(path.size(), 36U);
  for (size_t i = 0; i < path.size(); ++i) {
    const Eigen::Vector3d forward = path[i].rotation() * Eigen::Vector3d::UnitZ();
    EXPECT_NEAR(std::asin(-forward.z()) * 180 / M_PI, 30, 1e-6);
    EXPECT_NEAR((path[i].rotation() * Eigen::Vector3d::UnitX()).z(), 0, 1e-9) << "level";
    const Eigen::Vector3d next_forward = path[(i + 1) % 36].rotation() * Eigen::Vector3d::UnitZ();
    const double turn_rad = std::acos(forward.head<2>().normalized().dot(next_forward.head<2>().normalized()));
    EXPECT_NEAR(turn_rad, 2 * M_PI / 36, 1e-6);
    for (const SceneObject& object : scene.objects) {
      const Eigen::Vector3d p = path[i].Inverse() * object.T_world_object.translation();
      ASSERT_GT(p.z(), 0);
      const Eigen::Vector2d pixel = camera.Project(p);
      EXPECT_TRUE(pixel.x() > 0 && pixel.x() < camera.width_px && pixel.y() > 0 && pixel.y() < camera.height_px);
    }
  }
}

TEST(CameraPathTest, HandheldPathIsSmoothAndInsideTheRoom) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Scene scene = MakeScene({.seed = seed, .objects = 6});
    SynthOptions options{.seed = seed, .frames = 300, .path = PathKind::kHandheld};
    const auto path = Poses(options, scene);
    double lowest_m = 1e9, highest_m = 0;
    for (size_t i = 0; i < path.size(); ++i) {
      const Eigen::Vector3d& p = path[i].translation();
      EXPECT_LT(p.head<2>().cwiseAbs().maxCoeff(), scene.room_half_m - 0.3);
      lowest_m = std::min(lowest_m, p.z());
      highest_m = std::max(highest_m, p.z());
      if (i == 0) continue;
      EXPECT_LT((p - path[i - 1].translation()).norm(), 0.06);
      EXPECT_LT(path[i].rotation().angularDistance(path[i - 1].rotation()), 0.06);
    }
    EXPECT_GT(lowest_m, scene.table_height_m);
    EXPECT_LT(highest_m, 2.5);
    EXPECT_GT(highest_m - lowest_m, 0.05) << "height changes";
  }
}

TEST(CameraPathTest, HandMotionScalesTheVariation) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  const auto spread_m = [&](double hand_motion) {
    const SynthOptions options{.seed = 1, .frames = 300, .path = PathKind::kHandheld, .hand_motion = hand_motion};
    double nearest_m = 1e9, farthest_m = 0;
    for (const auto& pose : Poses(options, scene)) {
      const double distance_m = (pose.translation() - Eigen::Vector3d(0, 0, scene.table_height_m)).norm();
      nearest_m = std::min(nearest_m, distance_m);
      farthest_m = std::max(farthest_m, distance_m);
    }
    return farthest_m - nearest_m;
  };
  EXPECT_GT(spread_m(2.5), 1.5 * spread_m(1));
}

TEST(CameraPathTest, TwoRoundsPassThePlainWallAndReturn) {
  const Scene scene = MakeScene({.seed = 4, .objects = 4, .min_room_half_m = kTwoRoundsRoomHalf_m, .plain_wall = true});
  ASSERT_GE(scene.room_half_m, kTwoRoundsRoomHalf_m);
  const SynthOptions options{.seed = 4, .frames = 1200, .path = PathKind::kTwoRounds};
  const auto path = Poses(options, scene);
  double length_m = 0;
  int at_plain_wall = 0, at_table = 0;
  for (size_t i = 0; i < path.size(); ++i) {
    const Eigen::Vector3d& p = path[i].translation();
    ASSERT_LT(p.head<2>().cwiseAbs().maxCoeff(), scene.room_half_m - 0.4) << "furniture";
    const Eigen::Vector3d forward = path[i].rotation() * Eigen::Vector3d::UnitZ();
    // Intersection of the optical axis with the plane of the wall at y = half.
    const double s = (scene.room_half_m - p.y()) / forward.y();
    if (s > 0 && std::abs(p.x() + s * forward.x()) < 0.7 * scene.room_half_m) ++at_plain_wall;
    if (forward.head<2>().normalized().dot(-p.head<2>().normalized()) > 0.95) ++at_table;
    if (i == 0) continue;
    length_m += (p - path[i - 1].translation()).norm();
    ASSERT_LT((p - path[i - 1].translation()).norm(), 0.05);
    ASSERT_LT(path[i].rotation().angularDistance(path[i - 1].rotation()), 0.05);
  }
  EXPECT_GT(length_m, 15);
  EXPECT_LT((path.front().translation() - path.back().translation()).norm(), 0.3);
  EXPECT_LT(path.front().rotation().angularDistance(path.back().rotation()), 0.35);
  EXPECT_GT(at_plain_wall, 60);
  EXPECT_LT(at_plain_wall, 400);
  EXPECT_GT(at_table, 200);
}

TEST(CameraPathTest, ArcHasTheGivenAngle) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Scene scene = MakeScene({.seed = seed, .objects = 3});
    for (const PathKind path : {PathKind::kOrbit, PathKind::kHandheld}) {
      const SynthOptions options{.seed = seed, .frames = 200, .path = path, .arc_deg = 250};
      // Hand motion changes the azimuth by a few degrees.
      EXPECT_NEAR(std::abs(TotalAzimuth_deg(Poses(options, scene))), 250, 12);
    }
    const SynthOptions two_rounds{.seed = seed, .frames = 400, .path = PathKind::kHandheld, .arc_deg = 720};
    EXPECT_NEAR(std::abs(TotalAzimuth_deg(Poses(two_rounds, scene))), 720, 12);
  }
}

TEST(CameraPathTest, ArcVisitsNoPlaceTwice) {
  const Scene scene = MakeScene({.seed = 2, .objects = 3});
  const auto poses = Poses({.seed = 2, .frames = 200, .path = PathKind::kHandheld, .arc_deg = 250}, scene);
  double nearest_m = 1e9;
  for (size_t i = 0; i < poses.size(); ++i) {
    for (size_t j = i + 60; j < poses.size(); ++j) {
      nearest_m = std::min(nearest_m, (poses[i].translation() - poses[j].translation()).norm());
    }
  }
  EXPECT_GT(nearest_m, 0.15);
}

TEST(CameraPathTest, RotationKeepsThePositionAndReachesTheGivenSpeed) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Scene scene = MakeScene({.seed = seed, .objects = 3});
    const SynthOptions options{.seed = seed,
                               .frames = 400,
                               .path = PathKind::kRotation,
                               .rotation = {.speed_deg = 6, .range_deg = 40, .sway_mm = 20}};
    const auto poses = Poses(options, scene);
    const PeakMotion peak = FindPeakMotion(poses, 0, poses.size());
    EXPECT_GT(peak.rotation_deg, 4.5);
    EXPECT_LT(peak.rotation_deg, 6.2);
    EXPECT_GT(peak.translation_mm, 0.5);
    EXPECT_LT(peak.translation_mm, 6);
    Eigen::AlignedBox3d positions, rotations;
    for (const auto& pose : poses) {
      positions.extend(pose.translation());
      const Eigen::AngleAxisd relative(poses[0].rotation().conjugate() * pose.rotation());
      rotations.extend(relative.angle() * relative.axis());
    }
    EXPECT_LT(positions.sizes().maxCoeff(), 0.045);
    EXPECT_GT(positions.sizes().maxCoeff(), 0.01);
    EXPECT_GT(rotations.sizes().minCoeff(), 35 * kRadPerDeg) << "rotates about all three axes";
  }
}

TEST(CameraPathTest, RotatesFirstThenFollowsThePath) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  SynthOptions options{.seed = 1, .frames = 300, .path = PathKind::kHandheld};
  options.rotation = {.first_frames = 120, .speed_deg = 3, .sway_mm = 5};
  const auto poses = Poses(options, scene);
  EXPECT_GT(FindPeakMotion(poses, 0, 120).rotation_deg, 2);
  EXPECT_LT(FindPeakMotion(poses, 110, 125).rotation_deg, 3.1) << "no jump at the start of the path";
  for (size_t i = 0; i < 120; ++i) {
    EXPECT_LT((poses[i].translation() - poses[120].translation()).norm(), 0.012) << i;
  }
  // The remaining frames follow the path of a sequence without rotation in place.
  const auto only_path = Poses({.seed = 1, .frames = 180, .path = PathKind::kHandheld}, scene);
  for (size_t i = 0; i < only_path.size(); ++i) {
    EXPECT_LT((poses[120 + i].translation() - only_path[i].translation()).norm(), 1e-9);
    EXPECT_LT(poses[120 + i].rotation().angularDistance(only_path[i].rotation()), 1e-6);
  }
}

TEST(CameraPathTest, ShakeHasTheGivenPeakSpeed) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  const SynthOptions options{.seed = 1,
                             .frames = 200,
                             .path = PathKind::kRotation,
                             .rotation = {.speed_deg = 0.01, .sway_mm = 0},
                             .shake_deg = 4,
                             .shake_mm = 30};
  const auto poses = Poses(options, scene);
  const PeakMotion peak = FindPeakMotion(poses, 0, poses.size());
  EXPECT_NEAR(peak.rotation_deg, 4, 0.2);
  EXPECT_NEAR(peak.translation_mm, 30, 1e-6);
}

TEST(CameraPathTest, JumpTurnsTheViewAwayFromTheTable) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  SynthOptions options{.seed = 1, .frames = 100, .path = PathKind::kHandheld};
  const auto without = Poses(options, scene);
  options.jump = {.frame = 51, .turn_deg = 180};
  const auto with = Poses(options, scene);
  for (size_t i = 0; i < with.size(); ++i) {
    EXPECT_LT((with[i].translation() - without[i].translation()).norm(), 1e-9);
    const Eigen::Vector3d forward = with[i].rotation() * Eigen::Vector3d::UnitZ();
    const double toward_table = forward.head<2>().dot(-with[i].translation().head<2>());
    EXPECT_EQ(toward_table > 0, i < 50) << i;
  }
}

TEST(CameraPathTest, PosesAreContinuousInTheOffset) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  SynthOptions options{.seed = 1, .frames = 100, .path = PathKind::kHandheld, .shake_deg = 2, .shake_mm = 5};
  options.rotation.first_frames = 40;
  const CameraPath path(options, scene, SynthCamera(options));
  for (int i = 0; i + 1 < options.frames; ++i) {
    EXPECT_LT((path.Pose(i, 1).translation() - path.Pose(i + 1).translation()).norm(), 1e-9);
    EXPECT_LT(path.Pose(i, 0.5).rotation().angularDistance(path.Pose(i + 1, -0.5).rotation()), 1e-6);
  }
}

TEST(CameraPathTest, SeedsDiffer) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  const auto first = Poses({.seed = 1, .frames = 100, .path = PathKind::kRotation}, scene);
  const auto second = Poses({.seed = 2, .frames = 100, .path = PathKind::kRotation}, scene);
  EXPECT_GT(first[50].rotation().angularDistance(first[0].rotation() * second[0].rotation().conjugate() *
                                                 second[50].rotation()),
            2 * kRadPerDeg);
}

}  // namespace romap::synth::camera_path_test
