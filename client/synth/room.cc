// The room around the table: floor, walls with posters and furniture, ceiling, two lights.

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "client/synth/scene.h"

namespace romap::synth {
namespace {

constexpr float kRoomHeight_m = 2.6F;

// A rectangle from `corner` along `u` and `v` with front side u x v, in squares of about `cell_m`.
Mesh Sheet(const Point& corner, const Point& u, const Point& v, float cell_m) {
  const auto columns = static_cast<uint32_t>(std::max(1.0F, std::ceil(u.norm() / cell_m)));
  const auto rows = static_cast<uint32_t>(std::max(1.0F, std::ceil(v.norm() / cell_m)));
  Mesh mesh;
  for (uint32_t j = 0; j <= rows; ++j) {
    for (uint32_t i = 0; i <= columns; ++i) {
      mesh.vertices.emplace_back(corner + u * (static_cast<float>(i) / static_cast<float>(columns)) +
                                 v * (static_cast<float>(j) / static_cast<float>(rows)));
    }
  }
  for (uint32_t j = 0; j < rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      const uint32_t a = j * (columns + 1) + i;
      mesh.triangles.push_back({a, a + 1, a + columns + 2});
      mesh.triangles.push_back({a, a + columns + 2, a + columns + 1});
    }
  }
  return mesh;
}

void AddPart(Scene& scene, const Mesh& mesh, const Material& material) {
  AddSurface(scene, mesh, SE3<World, Object>(), material, 0);
}

// Colors paler and more similar than those of RandomMaterial: a background that still has corners to track.
Material Backdrop(Pattern pattern, float scale_m, Random& random) {
  Material material = RandomMaterial(pattern, scale_m, random);
  const double hue = random.Uniform();
  material.colors = {FromHsv(hue, random.Uniform(0.05, 0.35), random.Uniform(0.7, 0.9)),
                     FromHsv(hue + 0.08, random.Uniform(0.1, 0.4), random.Uniform(0.45, 0.65)),
                     FromHsv(hue + 0.5, random.Uniform(0.1, 0.4), random.Uniform(0.3, 0.55))};
  return material;
}

Material WoodMaterial(Random& random, float scale_m) {
  Material wood = RandomMaterial(Pattern::kWood, scale_m, random);
  const double hue = random.Uniform(0.05, 0.1);
  const double value = random.Uniform(0.5, 0.8);
  wood.colors = {FromHsv(hue, 0.5, value), FromHsv(hue - 0.01, 0.6, 0.62 * value), FromHsv(hue, 0.6, 0.4 * value)};
  return wood;
}

// Adds a part of a wall, modeled at x = half_m, facing -x, and rotated about z by `turn_rad`.
using AddWallPart = std::function<void(const Mesh& mesh, const Material& material)>;

// Textures in the frame of the room: walls differ even with equal materials.
AddWallPart WallInRoomFrame(Scene& scene, float turn_rad) {
  return [&scene, turn = Turn(turn_rad, Point::UnitZ())](const Mesh& mesh, const Material& material) {
    AddPart(scene, Moved(mesh, turn, Point::Zero()), material);
  };
}

// Textures in the frame of the wall: equal materials give equal walls.
AddWallPart WallInOwnFrame(Scene& scene, float turn_rad) {
  const SE3<World, Object> T_world_wall(Turn(turn_rad, Point::UnitZ()).cast<double>(), Eigen::Vector3d::Zero());
  return [&scene, T_world_wall](const Mesh& mesh, const Material& material) {
    AddSurface(scene, mesh, T_world_wall, material, 0);
  };
}

// A wall with posters and furniture.
void AddWall(const AddWallPart& add, Random& random, float half_m) {
  constexpr Pattern kPatterns[] = {Pattern::kSpeckle, Pattern::kTiles, Pattern::kMarble, Pattern::kStripes};
  add(Sheet(Point(half_m, half_m, 0), Point(0, -2 * half_m, 0), Point(0, 0, kRoomHeight_m), 0.1F),
      Backdrop(kPatterns[random.Below(4)], random.UniformFloat(0.12, 0.3), random));
  // Posters above, chests and bookshelves below.
  float y_m = -half_m + 0.2F;
  while (y_m < half_m - 0.7F) {
    const float half_width_m = random.UniformFloat(0.18, 0.34);
    const float half_height_m = random.UniformFloat(0.2, 0.38);
    add(RoundedBox(Point(half_m - 0.005F, y_m + half_width_m, random.UniformFloat(1.25, 1.8)),
                   Point(0.008F, half_width_m, half_height_m), 0.002F, 0.1F),
        Backdrop(Pattern::kPrint, random.UniformFloat(0.06, 0.14), random));
    y_m += 2 * half_width_m + random.UniformFloat(0.05, 0.25);
  }
  y_m = -half_m + 0.5F;
  while (y_m < half_m - 0.9F) {
    const Point half(random.UniformFloat(0.12, 0.2), random.UniformFloat(0.2, 0.4), random.UniformFloat(0.2, 0.5));
    constexpr Pattern kFronts[] = {Pattern::kTiles, Pattern::kPrint, Pattern::kChecks, Pattern::kFabric};
    add(RoundedBox(Point(half_m - half.x(), y_m + half.y(), half.z()), half, 0.01F, 0.08F),
        random.Chance(0.4) ? WoodMaterial(random, 0.03F)
                           : Backdrop(kFronts[random.Below(4)], random.UniformFloat(0.06, 0.12), random));
    y_m += 2 * half.y() + random.UniformFloat(0.02, 0.5);
  }
}

// An almost textureless wall: one color with weak grain and a few small notes.
void AddPlainWall(const AddWallPart& add, Random& random, float half_m) {
  Material paint = Backdrop(Pattern::kPlain, 0.1F, random);
  paint.grain = 0.03F;
  add(Sheet(Point(half_m, half_m, 0), Point(0, -2 * half_m, 0), Point(0, 0, kRoomHeight_m), 0.1F), paint);
  for (float y_m = -half_m + 0.3F; y_m < half_m - 0.3F; y_m += random.UniformFloat(0.5, 0.8)) {
    const Point half(0.004F, random.UniformFloat(0.03, 0.06), random.UniformFloat(0.04, 0.08));
    add(RoundedBox(Point(half_m - 0.004F, y_m, random.UniformFloat(0.9, 1.6)), half, 0.001F, 0.05F),
        Backdrop(Pattern::kPrint, 0.03F, random));
  }
}

void AddWalls(Scene& scene, const SceneOptions& options, Random& random) {
  const auto half_m = static_cast<float>(scene.room_half_m);
  const bool identical = options.surroundings.walls == Walls::kIdentical;
  const Random at_first_wall = random;
  for (int side = 0; side < 4; ++side) {
    const float turn_rad = 0.5F * std::numbers::pi_v<float> * static_cast<float>(side);
    if (identical) random = at_first_wall;
    const AddWallPart add = identical ? WallInOwnFrame(scene, turn_rad) : WallInRoomFrame(scene, turn_rad);
    const bool plain = options.plain_wall && !identical && side == 1;
    (plain ? AddPlainWall : AddWall)(add, random, half_m);
  }
}

Material TableMaterial(const TableTexture& texture, const Eigen::Vector2f& half_m, Random& random) {
  constexpr Pattern kCloths[] = {Pattern::kFabric, Pattern::kMarble, Pattern::kTiles, Pattern::kSpeckle};
  const auto cloth = [&] { return Backdrop(kCloths[random.Below(4)], random.UniformFloat(0.05, 0.1), random); };
  Material top;
  switch (texture.kind) {
    case TableTexture::Kind::kDistinct:
      top = random.Chance(0.4) ? WoodMaterial(random, 0.018F) : cloth();
      top.grain = 0.25F;
      break;
    case TableTexture::Kind::kRepeated:
      top = cloth();
      top.grain = 0.25F;
      top.period_m = 2 * half_m / static_cast<float>(texture.repeats);
      break;
    case TableTexture::Kind::kPlain:
    case TableTexture::Kind::kFaint:
      top.colors[0] = FromHsv(random.Uniform(), random.Uniform(0.02, 0.08), random.Uniform(0.85, 0.93));
      top.grain = texture.kind == TableTexture::Kind::kFaint ? 0.02F : 0;
      break;
  }
  return top;
}

void AddTable(Scene& scene, const TableTexture& texture, Random& random) {
  const auto height_m = static_cast<float>(scene.table_height_m);
  const auto half_x = static_cast<float>(scene.layout_radius_m) + random.UniformFloat(0.15, 0.3);
  const auto half_y = static_cast<float>(scene.layout_radius_m) + random.UniformFloat(0.08, 0.18);
  const Material top = TableMaterial(texture, {half_x, half_y}, random);
  const Material frame = WoodMaterial(random, 0.02F);
  // Fine cells resolve the shadows around the objects.
  AddPart(scene, Sheet(Point(-half_x, -half_y, height_m), Point(2 * half_x, 0, 0), Point(0, 2 * half_y, 0), 0.007F),
          top);
  constexpr float kHalfSlab_m = 0.015F;
  AddPart(scene,
          RoundedBox(Point(0, 0, height_m - kHalfSlab_m - 0.001F), Point(half_x + 0.002F, half_y + 0.002F, kHalfSlab_m),
                     0.004F, 0.05F),
          frame);
  for (const float x : {-1.0F, 1.0F}) {
    for (const float y : {-1.0F, 1.0F}) {
      const Point half(0.025F, 0.025F, 0.5F * height_m - 0.02F);
      AddPart(scene, RoundedBox(Point(x * (half_x - 0.06F), y * (half_y - 0.06F), half.z()), half, 0.006F, 0.06F),
              frame);
    }
  }
}

// Floor, ceiling, walls and table.
void AddSurfaces(Scene& scene, const SceneOptions& options, Random& random) {
  const auto half_m = static_cast<float>(scene.room_half_m);
  const Material floor = random.Chance(0.5) ? Backdrop(Pattern::kTiles, random.UniformFloat(0.2, 0.35), random)
                                            : Backdrop(Pattern::kFabric, random.UniformFloat(0.12, 0.25), random);
  AddPart(scene, Sheet(Point(-half_m, -half_m, 0), Point(2 * half_m, 0, 0), Point(0, 2 * half_m, 0), 0.05F), floor);
  if (options.surroundings.walls != Walls::kNone) {
    Material ceiling;
    ceiling.colors[0] = Rgb::Constant(0.8F);
    AddPart(scene,
            Sheet(Point(-half_m, half_m, kRoomHeight_m), Point(2 * half_m, 0, 0), Point(0, -2 * half_m, 0), 0.3F),
            ceiling);
    AddWalls(scene, options, random);
  }
  AddTable(scene, options.surroundings.table, random);
}

}  // namespace

void AddRoom(Scene& scene, const SceneOptions& options, Random& random) {
  const float half_m =
      std::max(static_cast<float>(options.min_room_half_m), static_cast<float>(4.2 * scene.layout_radius_m) + 0.4F);
  scene.room_half_m = half_m;
  if (options.surroundings.background == Background::kRoom) AddSurfaces(scene, options, random);
  if (options.surroundings.background == Background::kGray) scene.background = FromHsv(0, 0, 0.5);

  // A warm panel above the table and cool daylight from one side. Both are rotated relative to the table: the samples
  // of a light parallel to an edge would align and produce steps in its shadow.
  const float daylight_rad = random.UniformFloat(0, 2 * std::numbers::pi_v<float>);
  const Point to_window(std::cos(daylight_rad), std::sin(daylight_rad), 0);
  const Point along_window(-to_window.y(), to_window.x(), 0);
  const Point lean = (Point::UnitZ() + 0.15F * along_window).normalized();
  scene.lights = {{Point(random.UniformFloat(-0.5, 0.5), random.UniformFloat(-0.5, 0.5), kRoomHeight_m - 0.15F),
                   Point(0.33F, 0.14F, 0), Point(-0.14F, 0.33F, 0), 2.0F * Rgb(1.0F, 0.92F, 0.8F)},
                  {0.85F * half_m * to_window + Point(0, 0, 1.75F), 0.5F * along_window, 0.4F * lean,
                   0.75F * half_m * half_m * Rgb(0.8F, 0.9F, 1.0F)}};
}

}  // namespace romap::synth
