#include "client/synth/scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "client/render/rasterizer.h"
#include "client/synth/bvh.h"
#include "client/synth/lighting.h"
#include "client/synth/noise.h"

namespace romap::synth::scene_test {

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

// The triangles of the room and their surfaces.
std::vector<Eigen::Vector3f> CentersOfRoom(const Scene& scene) {
  std::vector<Eigen::Vector3f> centers;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    if (scene.surfaces[scene.surface_of_triangle[i]].label != 0) continue;
    const auto& [a, b, c] = scene.triangles[i];
    centers.emplace_back((scene.positions_world[a] + scene.positions_world[b] + scene.positions_world[c]) / 3);
  }
  return centers;
}

// The surface of the top of the table and its bounds in x and y.
struct TableTop {
  const Material* material = nullptr;
  Eigen::AlignedBox3f bounds;
};

TableTop FindTableTop(const Scene& scene) {
  TableTop top;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const SceneSurface& surface = scene.surfaces[scene.surface_of_triangle[i]];
    const Eigen::Vector3f& p = scene.positions_world[scene.triangles[i][0]];
    if (surface.label != 0 || std::abs(p.z() - scene.table_height_m) > 1e-6) continue;
    top.material = &surface.material;
    for (const uint32_t corner : scene.triangles[i]) top.bounds.extend(scene.positions_world[corner]);
  }
  return top;
}

// Albedo of the table at a share 0..1 of its sides.
Rgb TableAlbedo(const TableTop& top, float x, float y) {
  const Eigen::Vector3f p = top.bounds.min() + top.bounds.sizes().cwiseProduct(Eigen::Vector3f(x, y, 0));
  return Albedo(*top.material, p, Eigen::Vector3f::UnitZ(), 0.001F);
}

TEST(SurroundingsTest, RepeatedTableTextureHasTheGivenNumberOfTiles) {
  std::set<float> first_values;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const TableTexture texture{.kind = TableTexture::Kind::kRepeated, .repeats = 2};
    const Scene scene = MakeScene({.seed = seed, .objects = 2, .surroundings = {.table = texture}});
    const TableTop top = FindTableTop(scene);
    ASSERT_NE(top.material, nullptr);
    float highest_difference = 0, contrast = 0;
    for (int k = 0; k < 200; ++k) {
      const float x = 0.01F + 0.48F * CellUniform(k, 0, 0, 1);
      const float y = 0.01F + 0.48F * CellUniform(k, 1, 0, 1);
      const Rgb color = TableAlbedo(top, x, y);
      for (const auto& [dx, dy] : {std::pair{0.5F, 0.0F}, {0.0F, 0.5F}, {0.5F, 0.5F}}) {
        highest_difference = std::max(highest_difference, (TableAlbedo(top, x + dx, y + dy) - color).norm());
      }
      contrast = std::max(contrast, (TableAlbedo(top, x + 0.25F, y) - color).norm());
    }
    EXPECT_LT(highest_difference, 0.02F) << "seed " << seed;
    EXPECT_GT(contrast, 0.1F) << "a quarter of the table is not a period";
    first_values.insert(TableAlbedo(top, 0.3F, 0.4F).x());
  }
  EXPECT_EQ(first_values.size(), 4U) << "seeds differ";
}

TEST(SurroundingsTest, PlainTableIsLightAndConstant) {
  for (const auto& [kind, limit] : {std::pair{TableTexture::Kind::kPlain, 1e-6F}, {TableTexture::Kind::kFaint, 0.1F}}) {
    const Scene scene = MakeScene({.seed = 3, .objects = 2, .surroundings = {.table = {.kind = kind}}});
    const TableTop top = FindTableTop(scene);
    ASSERT_NE(top.material, nullptr);
    Eigen::AlignedBox3f colors;
    for (int k = 0; k < 500; ++k) colors.extend(TableAlbedo(top, CellUniform(k, 0, 0, 1), CellUniform(k, 1, 0, 1)));
    EXPECT_GT(colors.min().minCoeff(), 0.5F) << "light";
    EXPECT_LE(colors.sizes().maxCoeff(), limit);
    EXPECT_EQ(colors.sizes().maxCoeff() > 0, kind == TableTexture::Kind::kFaint);
  }
}

// The color of a wall at y and z, seen from the center of the room; `side` counts quarter turns.
Rgb WallColor(const Scene& scene, const Bvh& bvh, int side, float y_m, float z_m) {
  const auto turn = Turn(static_cast<float>(M_PI / 2 * side), Point::UnitZ());
  const Point direction = turn * Point(static_cast<float>(scene.room_half_m), y_m, z_m - 1.5F);
  const Point origin(0, 0, 1.5F);
  const auto hit = bvh.Nearest(origin, direction);
  if (!hit) return Rgb::Zero();
  const auto& corner = scene.triangles[hit->triangle];
  const auto& world = scene.positions_world;
  const auto& local = scene.positions_local;
  const Eigen::Vector3f weights = render::Barycentrics({world[corner[0]], world[corner[1]], world[corner[2]]},
                                                       origin.cast<double>(), direction.cast<double>());
  const Point p_local =
      weights.x() * local[corner[0]] + weights.y() * local[corner[1]] + weights.z() * local[corner[2]];
  const Point normal = (local[corner[1]] - local[corner[0]]).cross(local[corner[2]] - local[corner[0]]).normalized();
  const Material& material = scene.surfaces[scene.surface_of_triangle[hit->triangle]].material;
  return Albedo(material, p_local, normal, 0.002F);
}

TEST(SurroundingsTest, IdenticalWallsDifferOnlyByRotation) {
  for (const Walls walls : {Walls::kDistinct, Walls::kIdentical}) {
    const Scene scene = MakeScene({.seed = 2, .objects = 2, .surroundings = {.walls = walls}});
    const Bvh bvh(scene.positions_world, scene.triangles);
    int different = 0, total = 0;
    for (float y_m = -1.5F; y_m <= 1.5F; y_m += 0.137F) {
      for (float z_m = 0.9F; z_m <= 2.3F; z_m += 0.171F) {
        for (int side = 1; side < 4; ++side) {
          const Rgb difference = WallColor(scene, bvh, side, y_m, z_m) - WallColor(scene, bvh, 0, y_m, z_m);
          different += difference.norm() > 0.02F ? 1 : 0;
          ++total;
        }
      }
    }
    if (walls == Walls::kIdentical) {
      EXPECT_LT(different, total / 50) << "rays that hit an edge";
    } else {
      EXPECT_GT(different, total / 2);
    }
  }
}

TEST(SurroundingsTest, WithoutWallsOnlyFloorAndTableRemain) {
  const Scene scene = MakeScene({.seed = 2, .objects = 2, .surroundings = {.walls = Walls::kNone}});
  const auto centers = CentersOfRoom(scene);
  EXPECT_FALSE(centers.empty());
  for (const Eigen::Vector3f& center : centers) ASSERT_LE(center.z(), scene.table_height_m + 1e-5);
}

TEST(SurroundingsTest, BlackAndGrayBackgroundsHaveOnlyObjects) {
  for (const Background background : {Background::kBlack, Background::kGray}) {
    const Scene scene = MakeScene({.seed = 2, .objects = 2, .surroundings = {.background = background}});
    EXPECT_TRUE(CentersOfRoom(scene).empty());
    EXPECT_EQ(scene.objects.size(), 2U);
    EXPECT_FALSE(scene.lights.empty());
    EXPECT_EQ(scene.background.isZero(), background == Background::kBlack);
  }
}

}  // namespace romap::synth::scene_test
