#include "server/mesh/sample_field.h"

#include <gtest/gtest.h>

#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::mesh::sample_field_test {

constexpr int kNodes = 64;

SampledField SampleOf(const FieldSnapshot& snapshot, int nodes = kNodes) {
  return SampleField(snapshot, SurfaceProbe(snapshot), Eigen::Vector3i::Constant(nodes));
}

// Unedited nodes on the wrong side of the surface.
size_t WrongNodes(const FieldGrid& grid, const InsideDistance& distance) {
  size_t wrong = 0;
  for (size_t node = 0; node < grid.value.size(); ++node) {
    if (grid.edited[node] != 0 || grid.value[node] == kBeyondBox) continue;
    wrong += (grid.value[node] > 0) != (distance(grid.Position(grid.NodeAt(node))) > 0);
  }
  return wrong;
}

// A stem with a diameter of 1.5 cells, from the center to a corner of the box.
InsideDistance Twig() {
  const Eigen::Vector3f tip(0.85f, 0.6f, 0.75f);
  const float radius = 0.75f * 2.0f / (kNodes - 1);
  return [=](const Eigen::Vector3f& p) {
    const float along = std::clamp(p.dot(tip) / tip.squaredNorm(), 0.0f, 1.0f);
    return radius - (p - along * tip).norm();
  };
}

TEST(SampleField, ValuesAreLogarithmsOfTheDensity) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.6f));  // raw = level + 60 distance
  snapshot.optics.raw_per_efold = 4;
  const FieldGrid grid = SampleOf(snapshot).grid;
  size_t checked = 0;
  for (size_t node = 0; node < grid.value.size(); ++node) {
    const float value = 15 * Sphere(0.6f)(grid.Position(grid.NodeAt(node)));
    if (std::abs(value) > 1 || grid.edited[node] != 0) continue;
    EXPECT_NEAR(grid.value[node], value, 1e-3f);
    ++checked;
  }
  EXPECT_GT(checked, 1000u);
}

TEST(SampleField, FindsTheSideOfAllNodesFromFewSamples) {
  for (const InsideDistance& shape : {Sphere(0.6f), Torus(0.6f, 0.2f), Sphere(0.2f, {0.5f, 0.5f, -0.5f})}) {
    const SampledField sampled = SampleOf(SnapshotOf(shape));
    EXPECT_EQ(WrongNodes(sampled.grid, shape), 0u);
    EXPECT_LT(sampled.samples, size_t{kNodes * kNodes * kNodes} / 2);
    EXPECT_GT(sampled.samples, 1000u);
  }
}

TEST(SampleField, FindsStemsOneAndAHalfCellsThick) {
  const InsideDistance flower = Union({Twig(), Sphere(0.3f)});
  for (const InsideDistance& shape : {flower, Twig(), Stem(-0.8f, 0.8f, 0.75f * 2 / (kNodes - 1))}) {
    EXPECT_EQ(WrongNodes(SampleOf(SnapshotOf(shape)).grid, shape), 0u);
  }
}

// At this slope most of the stem lies between lattice nodes that are all clearly empty.
TEST(SampleField, FollowsAStemThatTheLatticeMisses) {
  const InsideDistance flower = Union({Twig(), Sphere(0.3f)});
  const InsideDistance steep = [&](const Eigen::Vector3f& p) { return 12 * flower(p); };
  EXPECT_EQ(WrongNodes(SampleOf(SnapshotOf(steep)).grid, flower), 0u);
}

TEST(SampleField, UnreachedSpaceIsSolid) {
  const InsideDistance shell = [](const Eigen::Vector3f& p) { return 0.1f - std::abs(p.norm() - 0.6f); };
  const FieldGrid grid = SampleOf(SnapshotOf(shell)).grid;
  for (size_t node = 0; node < grid.value.size(); ++node) {
    const Eigen::Vector3f p = grid.Position(grid.NodeAt(node));
    if (p.norm() < 0.48f) {
      EXPECT_EQ(grid.value[node], kSolid);
      EXPECT_EQ(grid.edited[node], 1);
    } else if (p.norm() > 0.72f) {
      EXPECT_LT(grid.value[node], 0);
    }
  }
}

TEST(SampleField, NodesOutsideTheHullAreEmptyAndNotSampled) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.8f));
  const size_t all = SampleOf(snapshot).samples;
  snapshot.hull.resolution = 8;
  for (int cell = 0; cell < 512; ++cell) snapshot.hull.bits.push_back(cell / 64 < 4);  // z < 0 only
  const SampledField sampled = SampleOf(snapshot);
  EXPECT_LT(sampled.samples, 2 * all / 3);
  for (size_t node = 0; node < sampled.grid.value.size(); ++node) {
    const float z = sampled.grid.NodeAt(node).z();
    if (z < 33 || sampled.grid.value[node] == kBeyondBox) continue;
    EXPECT_EQ(sampled.grid.value[node], kEmpty);
  }
}

}  // namespace romap::mesh::sample_field_test
