#include "server/mesh/grid_resolution.h"

#include <gtest/gtest.h>

#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::mesh::grid_resolution_test {

TEST(ChooseNodes, CellsAreCubesUnlessASideIsTooShort) {
  const FieldSnapshot snapshot = SnapshotOf(Sphere(0.5f), {1.0f, 0.5f, 0.02f});
  MeshConfig config;
  config.resolution = 65;
  config.min_side_nodes = 12;
  EXPECT_EQ(ChooseNodes(snapshot, config), Eigen::Vector3i(65, 33, 12));
  config.min_side_nodes = 100;  // at most the number of the longest side
  EXPECT_EQ(ChooseNodes(snapshot, config), Eigen::Vector3i(65, 65, 65));
}

TEST(ChooseNodes, AdaptsToTheSizeInWellResolvedViews) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.converged = true;
  MeshConfig config;
  config.pixels_per_node = 2;
  config.min_side_nodes = 2;
  const auto nodes_at = [&](double distance) {
    snapshot.cameras.assign(4, ViewFrom({0, 0, static_cast<float>(distance)}));
    return ChooseNodes(snapshot, config).x();
  };
  // The side of 2 is 800 / distance pixels long, at a focal length of 400 px.
  EXPECT_EQ(nodes_at(5), 80);
  EXPECT_EQ(nodes_at(10), 40);
  EXPECT_EQ(nodes_at(1), 128);
  EXPECT_EQ(nodes_at(100), 32);
  snapshot.cameras.push_back(ViewFrom({0, 0, 1}));  // one sharper view is not enough
  EXPECT_EQ(ChooseNodes(snapshot, config).x(), 32);
  snapshot.converged = false;
  EXPECT_EQ(nodes_at(5), 64);
  EXPECT_EQ(nodes_at(10), 40);
  config.adapt_resolution = false;
  EXPECT_EQ(nodes_at(10), 64);
}

TEST(ChooseNodes, InvalidViewsAreIgnored) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.converged = true;
  snapshot.cameras = {ViewFrom({0, 0, std::numeric_limits<float>::quiet_NaN()}), ViewFrom({0, 0, 0})};
  EXPECT_EQ(ChooseNodes(snapshot, MeshConfig()).x(), 64);
}

}  // namespace romap::mesh::grid_resolution_test
