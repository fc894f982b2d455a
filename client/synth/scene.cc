#include "client/synth/scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "client/synth/solids.h"

namespace romap::synth {
namespace {

constexpr float kCreaseCosine = 0.766F;  // 40 degrees
constexpr double kGap_m = 0.03;          // minimal distance of the bounding circles of footprints

struct Chosen {
  const SolidKind* kind;
  Solid solid;
  bool twin = false;  // identical to the previous one
};

// Chooses kinds in random order; a kind repeats only after all others were chosen.
std::vector<Chosen> ChooseSolids(const SceneOptions& options, Random& random) {
  std::vector<const SolidKind*> deck;
  std::vector<Chosen> chosen;
  while (static_cast<int>(chosen.size()) < options.objects) {
    if (static_cast<int>(chosen.size()) < 2 * options.identical_pairs && chosen.size() % 2 == 1) {
      chosen.push_back({chosen.back().kind, chosen.back().solid, true});
      continue;
    }
    if (deck.empty()) {
      for (const SolidKind& kind : SolidKinds()) deck.push_back(&kind);
      for (size_t i = deck.size(); i > 1; --i) std::swap(deck[i - 1], deck[random.Below(static_cast<int>(i))]);
    }
    Random shape(random.Bits());
    Solid solid = deck.back()->make(shape);
    Settle(solid);
    chosen.push_back({deck.back(), std::move(solid)});
    deck.pop_back();
  }
  return chosen;
}

// Centers of non-overlapping circles with the given radii, packed around the origin. Places circles in descending order
// of radius at random positions in a disc that grows until a free position is found.
std::vector<Eigen::Vector2d> PlaceCircles(const std::vector<double>& radii_m, Random& random) {
  std::vector<size_t> order(radii_m.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return radii_m[a] > radii_m[b]; });
  std::vector<Eigen::Vector2d> centers_m(radii_m.size());
  std::vector<size_t> placed;
  double disc_m = 0.05;
  for (const size_t i : order) {
    for (int attempt = 0;; ++attempt) {
      if (attempt % 20 == 19) disc_m += 0.01;
      const double angle = random.Uniform(0, 2 * std::numbers::pi);
      const double distance_m = disc_m * std::sqrt(random.Uniform());
      centers_m[i] = distance_m * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      const bool free = std::all_of(placed.begin(), placed.end(), [&](size_t other) {
        return (centers_m[i] - centers_m[other]).norm() > radii_m[i] + radii_m[other] + kGap_m;
      });
      if (free) break;
    }
    placed.push_back(i);
  }
  // Center the layout on the origin.
  Eigen::AlignedBox2d bounds;
  for (const size_t i : placed) {
    bounds.extend(centers_m[i] - Eigen::Vector2d::Constant(radii_m[i]));
    bounds.extend(centers_m[i] + Eigen::Vector2d::Constant(radii_m[i]));
  }
  for (Eigen::Vector2d& center_m : centers_m) center_m -= bounds.center();
  return centers_m;
}

SceneObject PlaceOnTable(Chosen chosen, const Eigen::Vector2d& position_m, double yaw_rad, double table_height_m) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  const Eigen::AlignedBox3d bounds = Bounds(chosen.solid).cast<double>();
  SceneObject object;
  object.solid = std::move(chosen.solid);
  object.T_world_solid = {turn, Eigen::Vector3d(position_m.x(), position_m.y(), table_height_m)};
  object.T_world_object = {turn, object.T_world_solid * bounds.center()};
  object.half_extents_m = 0.5 * bounds.sizes();
  return object;
}

void AddObjects(Scene& scene, std::vector<Chosen> chosen, Random& random) {
  std::vector<double> radii_m;
  for (const Chosen& c : chosen) radii_m.push_back(FootprintRadius(c.solid));
  const std::vector<Eigen::Vector2d> positions_m = PlaceCircles(radii_m, random);
  std::map<std::string, int> kind_counts;
  for (const Chosen& c : chosen) ++kind_counts[c.kind->name];
  std::map<std::string, int> used;
  for (size_t i = 0; i < chosen.size(); ++i) {
    scene.layout_radius_m = std::max(scene.layout_radius_m, positions_m[i].norm() + radii_m[i]);
    const std::string kind = chosen[i].kind->name;
    SceneObject object = PlaceOnTable(std::move(chosen[i]), positions_m[i],
                                      random.Uniform(-std::numbers::pi, std::numbers::pi), scene.table_height_m);
    object.label = static_cast<uint8_t>(i + 1);
    object.name = kind_counts[kind] > 1 ? kind + "_" + std::to_string(++used[kind]) : kind;
    for (const SolidPart& part : object.solid.parts) {
      AddSurface(scene, part.mesh, object.T_world_solid, part.material, object.label);
    }
    scene.objects.push_back(std::move(object));
  }
}

}  // namespace

void AddSurface(Scene& scene, const Mesh& mesh_local, const SE3<World, Object>& T_world_local, const Material& material,
                uint8_t label) {
  // The copies of a vertex, one for each smooth surface that meets there.
  struct Copy {
    Eigen::Vector3f first_normal;
    uint32_t index;
  };
  std::vector<std::vector<Copy>> copies(mesh_local.vertices.size());
  const auto surface = static_cast<uint16_t>(scene.surfaces.size());
  scene.surfaces.push_back({material, label});
  const size_t first_new = scene.positions_world.size();
  const Eigen::Matrix3f rotation = T_world_local.RotationMatrix().cast<float>();
  for (const std::array<uint32_t, 3>& triangle : mesh_local.triangles) {
    const Eigen::Vector3f& a = mesh_local.vertices[triangle[0]];
    const Eigen::Vector3f area_normal =
        (mesh_local.vertices[triangle[1]] - a).cross(mesh_local.vertices[triangle[2]] - a);
    const Eigen::Vector3f normal = area_normal.normalized();
    std::array<uint32_t, 3> corners;
    for (int k = 0; k < 3; ++k) {
      std::vector<Copy>& here = copies[triangle[k]];
      auto copy = std::find_if(here.begin(), here.end(),
                               [&](const Copy& c) { return c.first_normal.dot(normal) > kCreaseCosine; });
      if (copy == here.end()) {
        const Eigen::Vector3f& p = mesh_local.vertices[triangle[k]];
        here.push_back({normal, static_cast<uint32_t>(scene.positions_world.size())});
        copy = here.end() - 1;
        scene.positions_local.push_back(p);
        scene.positions_world.push_back((T_world_local * p.cast<double>()).cast<float>());
        scene.normals_world.emplace_back(Eigen::Vector3f::Zero());
      }
      scene.normals_world[copy->index] += rotation * area_normal;
      corners[k] = copy->index;
    }
    scene.triangles.push_back(corners);
    scene.surface_of_triangle.push_back(surface);
  }
  for (size_t i = first_new; i < scene.normals_world.size(); ++i) scene.normals_world[i].normalize();
}

Scene MakeScene(const SceneOptions& options) {
  Scene scene;
  Random random(options.seed, 1);
  scene.table_height_m = random.Uniform(0.68, 0.78);
  AddObjects(scene, ChooseSolids(options, random), random);
  Random room_random(options.seed, 2);
  AddRoom(scene, options, room_random);
  return scene;
}

}  // namespace romap::synth
