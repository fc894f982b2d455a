#include "server/mesh/next_view.h"

#include <gtest/gtest.h>

#include <functional>

#include "server/mesh/extract_mesh.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::mesh::next_view_test {

MeshConfig UneditedConfig() {
  MeshConfig config;
  config.fill_unseen = false;
  config.cut_below_support = false;
  config.min_component_share = 0;
  return config;
}

// The surface with the confidence that `confidence` gives for each vertex.
Mesh Extract(const InsideDistance& shape, const std::function<float(const Eigen::Vector3f&)>& confidence) {
  FieldSnapshot snapshot = SnapshotOf(shape);
  snapshot.cameras = {ViewFrom({4, 0, 0})};
  auto mesh = ExtractMesh(snapshot, UneditedConfig());
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  for (size_t i = 0; i < mesh->vertices.size(); ++i) mesh->confidence[i] = confidence(mesh->vertices[i]);
  return *std::move(mesh);
}

TEST(NextViewTest, PointsToTheSideThatNoViewObserved) {
  const Mesh mesh = Extract(Sphere(0.6f), [](const Eigen::Vector3f& p) { return p.y() > -0.2f ? 0.9f : 0.0f; });
  const auto next = FindNextView(mesh);
  ASSERT_TRUE(next.has_value());
  EXPECT_NEAR(next->direction.norm(), 1, 1e-6);
  EXPECT_LT(next->direction.y(), -0.9);
  EXPECT_GT(next->gain, 0.1);
  EXPECT_LT(next->gain, 0.5);
}

TEST(NextViewTest, AWellObservedObjectNeedsNoFurtherView) {
  EXPECT_FALSE(FindNextView(Extract(Sphere(0.6f), [](const Eigen::Vector3f&) { return 0.97f; })).has_value());
}

TEST(NextViewTest, TheUndersideDoesNotCount) {
  const Mesh mesh = Extract(Sphere(0.6f), [](const Eigen::Vector3f& p) { return p.z() < -0.35f ? 0.0f : 1.0f; });
  EXPECT_FALSE(FindNextView(mesh).has_value());
}

// Only the side of the small ball that faces the large one is unknown, and the large one is in the way.
TEST(NextViewTest, HiddenSurfaceDoesNotCount) {
  const InsideDistance shape = Union({Sphere(0.45f, {-0.4f, 0, 0}), Sphere(0.3f, {0.5f, 0, 0})});
  const auto confidence = [](const Eigen::Vector3f& p) { return p.x() > 0.1f && p.x() < 0.45f ? 0.0f : 1.0f; };
  const auto next = FindNextView(Extract(shape, confidence));
  ASSERT_TRUE(next.has_value());
  EXPECT_GT(next->direction.head<2>().normalized().x(), -0.95);
}

TEST(NextViewTest, AMeshWithoutConfidenceGivesNoDirection) {
  Mesh mesh = Extract(Sphere(0.6f), [](const Eigen::Vector3f&) { return 0.0f; });
  mesh.confidence.clear();
  EXPECT_FALSE(FindNextView(mesh).has_value());
  EXPECT_FALSE(FindNextView(Mesh{}).has_value());
}

}  // namespace romap::mesh::next_view_test
