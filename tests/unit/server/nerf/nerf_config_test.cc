#include "server/nerf/nerf_config.h"

#include <gmock/gmock.h>

#include "server/nerf/presets.h"
#include "tests/support/config_faults.h"

namespace romap::nerf::nerf_config_test {

using ::testing::HasSubstr;

std::string Faults(const std::vector<std::string>& assignments) {
  return testing_support::FaultsOf<NerfConfig>("nerf", assignments);
}

TEST(NerfConfigTest, PresetsAreValid) {
  for (const std::string& preset : NerfPresetNames()) EXPECT_EQ(Faults({"nerf.preset=" + preset}), "");
}

TEST(NerfConfigTest, WidthMustBeAMultipleOfSixteen) {
  EXPECT_EQ(Faults({"nerf.hidden_width=48"}), "");
  EXPECT_EQ(Faults({"nerf.hidden_width=40"}), "--set nerf.hidden_width: 40 is not a multiple of 16");
}

TEST(NerfConfigTest, LowerBoundsMustNotExceedUpperBounds) {
  struct Rule {
    std::string low, low_value, high, high_value;
  };
  for (const Rule& rule : std::vector<Rule>{{"base_resolution", "256", "finest_resolution", "128"},
                                            {"min_samples_per_ray", "17", "max_samples_per_ray", "16"},
                                            {"initial_sharpness", "800", "final_sharpness", "700"},
                                            {"final_learning_rate", "0.02", "learning_rate", "0.01"},
                                            {"first_budget_steps", "601", "full_budget_steps", "600"},
                                            {"refine_steps_per_view", "7", "max_refine_steps", "6"}}) {
    const std::string low = "nerf." + rule.low, high = "nerf." + rule.high;
    EXPECT_EQ(Faults({low + "=" + rule.low_value, high + "=" + rule.high_value}),
              "--set: " + low + " = " + rule.low_value + " must not exceed " + high + " = " + rule.high_value);
    EXPECT_EQ(Faults({low + "=" + rule.low_value, high + "=" + rule.low_value}), "");
  }
}

TEST(NerfConfigTest, SomeRaysMustGoThroughTheObject) {
  EXPECT_EQ(Faults({"nerf.background_share=0.5", "nerf.sparse_depth_share=0.4"}), "");
  EXPECT_EQ(Faults({"nerf.background_share=0.5", "nerf.sparse_depth_share=0.5"}),
            "--set: nerf.background_share = 0.5 leaves no object rays with nerf.sparse_depth_share = 0.5; their sum "
            "must be below 1");
}

TEST(NerfConfigTest, CudaSupportsDensityOnAHashGridWithOneLayerOfAtMost128Neurons) {
  EXPECT_EQ(Faults({"nerf.backend=cuda", "nerf.hidden_width=128"}), "");
  const std::vector<std::string> unsupported = {"nerf.field=sdf", "nerf.encoding=frequency", "nerf.hidden_layers=2",
                                                "nerf.hidden_width=144"};
  for (const std::string& assignment : unsupported) {
    const size_t equals = assignment.find('=');
    EXPECT_THAT(Faults({"nerf.backend=cuda", assignment}),
                HasSubstr("nerf.backend = cuda does not support " + assignment.substr(0, equals) + " = " +
                          assignment.substr(equals + 1) + "; it supports "));
    EXPECT_EQ(Faults({"nerf.backend=auto", assignment}), "");
  }
}

}  // namespace romap::nerf::nerf_config_test
