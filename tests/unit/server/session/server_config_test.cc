#include "server/session/server_config.h"

#include <gtest/gtest.h>

#include "tests/support/config_faults.h"

namespace romap::session::server_config_test {

std::string Faults(const std::vector<std::string>& assignments) {
  return testing_support::FaultsOf<ServerConfig>("", assignments);
}

TEST(ServerConfigTest, DefaultsAreValid) { EXPECT_EQ(Faults({}), ""); }

TEST(ServerConfigTest, ViewsBeforeTrainingMustNotExceedAllViews) {
  EXPECT_EQ(Faults({"nerf.min_views=40"}), "");
  EXPECT_EQ(Faults({"nerf.min_views=41"}), "--set: nerf.min_views = 41 must not exceed objects.max_views = 40");
}

TEST(ServerConfigTest, TrainingThreadsAndSingleThreadExcludeEachOther) {
  EXPECT_EQ(Faults({"session.single_thread=true"}), "");
  EXPECT_EQ(Faults({"session.single_thread=true", "nerf.training_threads=2"}),
            "--set: nerf.training_threads = 2 has no effect with session.single_thread = true; leave one of them at "
            "its default");
}

TEST(ServerConfigTest, FaultsOfAllStagesAreReportedTogether) {
  EXPECT_EQ(Faults({"slam.scene_fast_min_threshold=20", "mesh.resolution=16", "nerf.min_views=41"}),
            "--set: slam.scene_fast_min_threshold = 20 must not exceed slam.scene_fast_threshold = 12; "
            "--set: mesh.min_side_nodes = 48 must not exceed mesh.resolution = 16; "
            "--set: nerf.min_views = 41 must not exceed objects.max_views = 40");
}

TEST(ServerConfigTest, EveryFieldHasAHelpTextThatStartsWithACapital) {
  ServerConfig config;
  ConfigFields fields;
  config.Fields(fields);
  for (const ConfigField& field : fields.fields()) {
    ASSERT_FALSE(field.info.help.empty()) << field.name;
    EXPECT_TRUE(std::isupper(static_cast<unsigned char>(field.info.help.front())) != 0 ||
                field.info.help.starts_with("log2"))
        << field.name;
  }
}

}  // namespace romap::session::server_config_test
