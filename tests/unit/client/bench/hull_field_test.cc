#include "client/bench/hull_field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/bench/true_views.h"
#include "server/mesh/extract_mesh.h"
#include "tests/unit/client/bench/tiny_sequence.h"

namespace romap::bench::hull_field_test {

struct HullFieldTest : public ::testing::Test {
  HullFieldTest() {
    const files::Sequence sequence = data.Open();
    const files::ObjectRecord& object = sequence.objects()->objects.front();
    nerf::NerfConfig config;
    config.hull_margin = 0;
    views = MakeTrueViews(*LoadTrueFrames(sequence, 1, 0), object, false);
    snapshot = MakeHullSnapshot(config, {object.T_world_object, object.half_extents, 1.0}, views);
  }

  float RawAt(const Eigen::Vector3f& radii) const {
    const std::vector<Eigen::Vector3f> points = {radius * radii};
    std::vector<float> raw(1);
    std::vector<Rgb8> rgb(1);
    snapshot.field->Sample(points, raw, rgb);
    return raw[0];
  }

  testing_support::TinySequence data;
  const float radius = static_cast<float>(testing_support::TinySequence::Balls().front().radius_m);
  std::vector<ObjectView> views;
  FieldSnapshot snapshot;
};

TEST_F(HullFieldTest, IsOccupiedInsideAndEmptyOutside) {
  EXPECT_EQ(snapshot.object.value, 1u);
  EXPECT_EQ(snapshot.cameras.size(), views.size());
  EXPECT_FLOAT_EQ(RawAt({0, 0, 0}), 10);
  EXPECT_FLOAT_EQ(RawAt({0.98f, 0.98f, 0.98f}), -10);
  EXPECT_EQ(RawAt({1.3f, 0, 0}), -1e4f);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(RawAt(0.85f * Eigen::Vector3f::Unit(axis)), 0) << axis;
    EXPECT_GT(RawAt(-0.85f * Eigen::Vector3f::Unit(axis)), 0) << axis;
  }
}

TEST_F(HullFieldTest, ValuesAreContinuousBetweenCells) {
  const float cell = 2 * snapshot.box_half_extents.x() / 64 / radius;
  const Eigen::Vector3f outwards = Eigen::Vector3f::Ones();
  float before = RawAt({0, 0, 0});
  int between = 0;
  for (float x = 0; x < 1; x += cell / 16) {
    const float raw = RawAt(x * outwards);
    EXPECT_LE(std::fabs(raw - before), 3 * 20.0f / 16 + 0.1f) << "at " << x;
    between += raw > -9.9f && raw < 9.9f;
    before = raw;
  }
  EXPECT_GE(between, 5);
}

// A cell is empty if its center is background in some view, so the hull agrees with the ball to about a pixel.
TEST_F(HullFieldTest, SurfaceIsCloseToTheBall) {
  const absl::StatusOr<Mesh> mesh = mesh::ExtractMesh(snapshot, mesh::MeshConfig());
  ASSERT_TRUE(mesh.ok()) << Message(mesh.status());
  ASSERT_GT(mesh->vertices.size(), 500u);
  double sum = 0;
  for (const Eigen::Vector3f& v : mesh->vertices) sum += v.norm();
  EXPECT_NEAR(sum / static_cast<double>(mesh->vertices.size()), radius, 0.08 * radius);
}

}  // namespace romap::bench::hull_field_test
