// Extraction from random fields, hulls, boxes and views gives a valid closed mesh or FAILED_PRECONDITION.
#include <gtest/gtest.h>

#include <bit>
#include <random>

#include "server/mesh/extract_mesh.h"
#include "tests/unit/server/mesh/field_fakes.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh::random_fields_test {

class Dice {
 public:
  explicit Dice(unsigned seed) : random_(seed) {}
  float Uniform(float from, float to) { return std::uniform_real_distribution<float>(from, to)(random_); }
  int Pick(int count) { return std::uniform_int_distribution<int>(0, count - 1)(random_); }
  Eigen::Vector3f Vector(float reach) {
    return {Uniform(-reach, reach), Uniform(-reach, reach), Uniform(-reach, reach)};
  }

 private:
  std::mt19937 random_;
};

// A pseudorandom number in 0..1 that depends on the position only.
float HashOf(const Eigen::Vector3f& p) {
  uint32_t hash = 2166136261u;
  for (int axis = 0; axis < 3; ++axis) hash = (hash ^ std::bit_cast<uint32_t>(p[axis])) * 16777619u;
  return static_cast<float>(hash >> 8) / static_cast<float>(1 << 24);
}

InsideDistance RandomField(Dice& dice, float reach) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const float shift = dice.Uniform(-0.5f, 0.5f);
  const Eigen::Vector3f direction = dice.Vector(1);
  switch (dice.Pick(6)) {
    case 0:  // noise
      return [=](const Eigen::Vector3f& p) { return reach * (HashOf(p) - 0.5f + 0.3f * shift); };
    case 1:  // noise with NaN and infinities
      return [=](const Eigen::Vector3f& p) {
        const float hash = HashOf(p);
        if (hash < 0.2f) return std::numeric_limits<float>::quiet_NaN();
        if (hash < 0.4f) return kInfinity;
        return hash < 0.6f ? -kInfinity : hash - 0.8f;
      };
    case 2:  // constant
      return [=](const Eigen::Vector3f&) { return shift; };
    case 3:  // a plane through the sides of the box
      return [=](const Eigen::Vector3f& p) { return direction.dot(p) + 0.3f * reach * shift; };
    case 4:  // waves
      return [=](const Eigen::Vector3f& p) {
        return reach *
               (std::sin(9 * p.x() / reach) * std::cos(7 * p.y() / reach) + std::sin(8 * p.z() / reach) + shift);
      };
    default:  // exactly at the surface level in a whole region
      return [=](const Eigen::Vector3f& p) { return std::max(0.0f, p.norm() - 0.5f * reach); };
  }
}

FieldSnapshot RandomSnapshot(Dice& dice) {
  const float scale = std::pow(10.0f, dice.Uniform(-2, 2));
  const Eigen::Vector3f box = scale * Eigen::Vector3f(dice.Uniform(0.02f, 1), dice.Uniform(0.02f, 1), 1);
  FieldSnapshot snapshot = SnapshotOf(RandomField(dice, scale), box);
  snapshot.converged = dice.Pick(2) == 0;
  if (dice.Pick(2) == 0) {
    snapshot.hull.resolution = 1 + dice.Pick(20);
    const int cells = snapshot.hull.resolution * snapshot.hull.resolution * snapshot.hull.resolution;
    for (int cell = 0; cell < cells; ++cell) snapshot.hull.bits.push_back(dice.Pick(4) != 0);
  }
  for (int view = dice.Pick(6); view > 0; --view) {
    snapshot.cameras.push_back(ViewFrom((scale * dice.Vector(4)).cast<double>()));  // some inside the box
    if (dice.Pick(8) == 0) snapshot.cameras.back() = ViewFrom(dice.Vector(1e30f).cast<double>());
  }
  return snapshot;
}

TEST(RandomFields, GiveValidClosedMeshesOrNone) {
  int meshes = 0;
  for (unsigned seed = 0; seed < 120; ++seed) {
    SCOPED_TRACE(seed);
    Dice dice(seed);
    MeshConfig config;
    config.resolution = 8 + dice.Pick(14);
    config.min_side_nodes = 2 + dice.Pick(8);
    config.fill_unseen = dice.Pick(2) == 0;
    config.cut_below_support = dice.Pick(2) == 0;
    const FieldSnapshot snapshot = RandomSnapshot(dice);
    const absl::StatusOr<Mesh> mesh = ExtractMesh(snapshot, config);
    if (!mesh.ok()) {
      EXPECT_EQ(mesh.status().code(), absl::StatusCode::kFailedPrecondition);
      continue;
    }
    ++meshes;
    ASSERT_TRUE(CheckTopology(*mesh).IsClosedManifold());
    EXPECT_GT(Volume(*mesh), 0);
    ASSERT_EQ(mesh->normals.size(), mesh->vertices.size());
    ASSERT_EQ(mesh->colors.size(), mesh->vertices.size());
    ASSERT_EQ(mesh->confidence.size(), mesh->vertices.size());
    const float reach = 1.01f;  // where the surface leaves the box, it is closed a thousandth of a cell outside
    for (size_t i = 0; i < mesh->vertices.size(); ++i) {
      ASSERT_TRUE(mesh->vertices[i].allFinite());
      ASSERT_LE(mesh->vertices[i].cwiseAbs().cwiseQuotient(snapshot.box_half_extents).maxCoeff(), reach);
      ASSERT_NEAR(mesh->normals[i].norm(), 1, 1e-4f);
      ASSERT_GE(mesh->confidence[i], 0);
      ASSERT_LE(mesh->confidence[i], 1);
    }
  }
  EXPECT_GT(meshes, 80);
}

TEST(RandomFields, GiveTheSameMeshEachTime) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    Dice once(seed), again(seed);
    const absl::StatusOr<Mesh> a = ExtractMesh(RandomSnapshot(once), {}), b = ExtractMesh(RandomSnapshot(again), {});
    ASSERT_EQ(a.ok(), b.ok());
    if (!a.ok()) continue;
    EXPECT_EQ(a->vertices, b->vertices);
    EXPECT_EQ(a->triangles, b->triangles);
    EXPECT_EQ(a->normals, b->normals);
    EXPECT_EQ(a->confidence, b->confidence);
  }
}

}  // namespace romap::mesh::random_fields_test
