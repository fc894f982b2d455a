#include "server/mesh/mesh_config.h"

#include <gtest/gtest.h>

#include "tests/support/config_faults.h"

namespace romap::mesh::mesh_config_test {

std::string Faults(const std::vector<std::string>& assignments) {
  return testing_support::FaultsOf<MeshConfig>("mesh", assignments);
}

TEST(MeshConfigTest, DefaultsAreValid) { EXPECT_EQ(Faults({}), ""); }

TEST(MeshConfigTest, NodesOfShortSidesMustNotExceedThoseOfTheLongest) {
  EXPECT_EQ(Faults({"mesh.resolution=48"}), "");
  EXPECT_EQ(Faults({"mesh.resolution=32"}), "--set: mesh.min_side_nodes = 48 must not exceed mesh.resolution = 32");
}

}  // namespace romap::mesh::mesh_config_test
