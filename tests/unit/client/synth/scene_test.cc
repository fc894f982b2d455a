#include "client/synth/scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "client/synth/camera_path.h"
#include "client/synth/lighting.h"

namespace romap::synth {
namespace {

TEST(MakeSceneTest, ObjectsStandOnTheTableWithoutContact) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Scene scene = MakeScene({.seed = seed, .objects = 16});
    ASSERT_EQ(scene.objects.size(), 16U);
    std::set<std::string> names;
    for (size_t i = 0; i < scene.objects.size(); ++i) {
      const SceneObject& a = scene.objects[i];
      EXPECT_EQ(a.label, i + 1);
      EXPECT_TRUE(names.insert(a.name).second) << a.name;
      EXPECT_NEAR(a.T_world_object.translation().z() - a.half_extents_m.z(), scene.table_height_m, 1e-6);
      EXPECT_LE(a.T_world_solid.translation().head<2>().norm() + FootprintRadius(a.solid),
                scene.layout_radius_m + 1e-6);
      for (size_t j = 0; j < i; ++j) {
        const SceneObject& b = scene.objects[j];
        const double distance_m = (a.T_world_solid.translation() - b.T_world_solid.translation()).head<2>().norm();
        EXPECT_GT(distance_m, FootprintRadius(a.solid) + FootprintRadius(b.solid)) << a.name << " and " << b.name;
      }
    }
  }
}

TEST(MakeSceneTest, CuboidsAreTight) {
  const Scene scene = MakeScene({.seed = 5, .objects = 8});
  for (const SceneObject& object : scene.objects) {
    const SE3<Object, World> T_object_world = object.T_world_object.Inverse();
    Eigen::AlignedBox3d bounds;
    for (const SolidPart& part : object.solid.parts) {
      for (const Point& p : part.mesh.vertices) {
        bounds.extend(T_object_world * (object.T_world_solid * p.cast<double>()));
      }
    }
    EXPECT_LT((bounds.max() - object.half_extents_m).norm(), 1e-6) << object.name;
    EXPECT_LT((bounds.min() + object.half_extents_m).norm(), 1e-6) << object.name;
  }
}

TEST(MakeSceneTest, MakesIdenticalPairsAndOtherwiseDifferentKinds) {
  const Scene scene = MakeScene({.seed = 6, .objects = 7, .identical_pairs = 2});
  const auto vertices = [&](size_t i) { return scene.objects[i].solid.parts[0].mesh.vertices; };
  EXPECT_EQ(vertices(0), vertices(1));
  EXPECT_EQ(vertices(2), vertices(3));
  EXPECT_NE(scene.objects[0].solid.class_name, scene.objects[2].solid.class_name);
  EXPECT_NE(scene.objects[4].name, scene.objects[5].name);
  EXPECT_EQ(scene.objects[0].solid.parts[0].material.seed, scene.objects[1].solid.parts[0].material.seed);
}

TEST(AddSurfaceTest, SharesSmoothVerticesAndSplitsEdges) {
  Scene scene;
  AddSurface(scene, RoundedBox(Point::Zero(), Point::Constant(0.1F), 0.002F, 1.0F), {}, {}, 1);
  for (const auto& triangle : scene.triangles) {
    const Eigen::Vector3f normal = (scene.positions_world[triangle[1]] - scene.positions_world[triangle[0]])
                                       .cross(scene.positions_world[triangle[2]] - scene.positions_world[triangle[0]])
                                       .normalized();
    for (const uint32_t corner : triangle) ASSERT_GT(normal.dot(scene.normals_world[corner]), 0.75F);
  }
}

TEST(BakeLightTest, CastsShadowsBelowAndBesideObjects) {
  Scene scene;
  const Mesh plate = RoundedBox(Point(0, 0, -0.01F), Point(0.5F, 0.5F, 0.01F), 0.001F, 0.02F);
  AddSurface(scene, plate, {}, {}, 0);
  const auto plate_vertices = static_cast<uint32_t>(scene.positions_world.size());
  AddSurface(scene, RoundedBox(Point(0, 0, 0.1F), Point(0.05F, 0.05F, 0.1F), 0.002F), {}, {}, 1);
  // The light is on the left (-x), so the shadow is on the right.
  scene.lights = {{Point(-1, 0, 1), Point(0, 0.1F, 0), Point(0.07F, 0, 0.07F), Rgb::Ones()}};
  BakeLight(scene);
  const auto irradiance_at = [&](float x, float y) {
    uint32_t best = 0;
    for (uint32_t i = 0; i < plate_vertices; ++i) {
      const auto distance = [&](uint32_t k) { return (scene.positions_world[k] - Point(x, y, 0)).norm(); };
      if (distance(i) < distance(best)) best = i;
    }
    return scene.irradiance[best].sum();
  };
  EXPECT_GT(irradiance_at(-0.2F, 0), 2 * irradiance_at(0.12F, 0)) << "shadow";
  EXPECT_GT(irradiance_at(0.12F, 0), irradiance_at(0, 0)) << "darkest below the object";
  EXPECT_GT(irradiance_at(0, 0.3F), 2 * irradiance_at(0.12F, 0)) << "outside the shadow";
}

TEST(MakeCameraPathTest, OrbitHasTheGivenElevationAndFacesTheTable) {
  const Scene scene = MakeScene({.seed = 2, .objects = 3});
  SynthOptions options{.seed = 2, .objects = 3, .frames = 36, .elevation_deg = 30};
  const CameraModel camera = SynthCamera(options);
  const auto path = MakeCameraPath(options, scene, camera);
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

TEST(MakeCameraPathTest, HandheldPathIsSmoothAndInsideTheRoom) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Scene scene = MakeScene({.seed = seed, .objects = 6});
    SynthOptions options{.seed = seed, .frames = 300, .path = PathKind::kHandheld};
    const auto path = MakeCameraPath(options, scene, SynthCamera(options));
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

TEST(MakeCameraPathTest, HandMotionScalesTheVariation) {
  const Scene scene = MakeScene({.seed = 1, .objects = 3});
  const auto spread_m = [&](double hand_motion) {
    const SynthOptions options{.seed = 1, .frames = 300, .path = PathKind::kHandheld, .hand_motion = hand_motion};
    double nearest_m = 1e9, farthest_m = 0;
    for (const auto& pose : MakeCameraPath(options, scene, SynthCamera(options))) {
      const double distance_m = (pose.translation() - Eigen::Vector3d(0, 0, scene.table_height_m)).norm();
      nearest_m = std::min(nearest_m, distance_m);
      farthest_m = std::max(farthest_m, distance_m);
    }
    return farthest_m - nearest_m;
  };
  EXPECT_GT(spread_m(2.5), 1.5 * spread_m(1));
}

TEST(MakeCameraPathTest, TwoRoundsPassThePlainWallAndReturn) {
  const Scene scene = MakeScene({.seed = 4, .objects = 4, .min_room_half_m = kTwoRoundsRoomHalf_m, .plain_wall = true});
  ASSERT_GE(scene.room_half_m, kTwoRoundsRoomHalf_m);
  const SynthOptions options{.seed = 4, .frames = 1200, .path = PathKind::kTwoRounds};
  const auto path = MakeCameraPath(options, scene, SynthCamera(options));
  double way_m = 0;
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
    way_m += (p - path[i - 1].translation()).norm();
    ASSERT_LT((p - path[i - 1].translation()).norm(), 0.05);
    ASSERT_LT(path[i].rotation().angularDistance(path[i - 1].rotation()), 0.05);
  }
  EXPECT_GT(way_m, 15);
  EXPECT_LT((path.front().translation() - path.back().translation()).norm(), 0.3);
  EXPECT_LT(path.front().rotation().angularDistance(path.back().rotation()), 0.35);
  EXPECT_GT(at_plain_wall, 60);
  EXPECT_LT(at_plain_wall, 400);
  EXPECT_GT(at_table, 200);
}

}  // namespace
}  // namespace romap::synth
