#include "server/nerf/presets.h"

#include <gtest/gtest.h>

#include "common/status.h"

namespace romap::nerf::presets_test {

ConfigFields FieldsOf(NerfConfig& config) {
  ConfigFields fields;
  fields.Section("nerf");
  config.Fields(fields);
  return fields;
}

std::string Dump(NerfConfig config) { return FieldsOf(config).DumpYaml(); }

TEST(PresetsTest, FastIsTheDefault) {
  EXPECT_EQ(NerfPresetNames().front(), "fast");
  EXPECT_EQ(Dump(*NerfPreset("fast")), Dump(NerfConfig()));
  EXPECT_FALSE(NerfPreset("slow").has_value());
}

TEST(PresetsTest, EveryPresetIsInRangeAndHasItsName) {
  for (const std::string& name : NerfPresetNames()) {
    const NerfConfig preset = *NerfPreset(name);
    EXPECT_EQ(preset.preset, name);
    NerfConfig read;
    const absl::Status status = FieldsOf(read).LoadYaml(Dump(preset), name);
    EXPECT_TRUE(status.ok()) << Message(status);
    EXPECT_EQ(Dump(read), Dump(preset));
  }
}

// The numbers of the paper's section "Implementation Details".
TEST(PresetsTest, PaperPresetHasTheValuesOfThePaper) {
  const NerfConfig c = *NerfPreset("paper");
  EXPECT_EQ(c.encoding, "hash");
  EXPECT_EQ(c.log2_table_entries, 16);
  EXPECT_EQ(c.finest_resolution, 2048);
  EXPECT_EQ(c.hidden_width, 64);
  EXPECT_EQ(c.hidden_layers, 1);
  EXPECT_EQ(c.rays_per_step, 4096);
  EXPECT_EQ(c.max_samples_per_ray, 32);
  EXPECT_EQ(c.sampling, "uniform");
  EXPECT_FALSE(c.carve_hull);
  EXPECT_EQ(c.depth_weight, 0.5);
  EXPECT_EQ(c.density_weight, 0.01);
  EXPECT_TRUE(c.random_background);
  EXPECT_EQ(c.opacity_weight_object, 0);
  EXPECT_EQ(c.opacity_weight_background, 0);
  EXPECT_EQ(c.first_budget_steps, 300);
  EXPECT_EQ(c.budget_steps_per_view, 300);
  EXPECT_EQ(c.max_extra_steps, 0);
}

TEST(PresetsTest, ExplicitKeysOverrideThePresetInAnyOrder) {
  for (const char* yaml :
       {"nerf:\n  preset: paper\n  hidden_width: 48\n", "nerf:\n  hidden_width: 48\n  preset: paper\n"}) {
    NerfConfig config;
    ASSERT_TRUE(FieldsOf(config).LoadYaml(yaml, "a.yaml").ok());
    EXPECT_EQ(config.hidden_width, 48);
    EXPECT_EQ(config.log2_table_entries, 16);
    EXPECT_EQ(config.preset, "paper");
  }
}

TEST(PresetsTest, AssignmentsAreAppliedInOrder) {
  NerfConfig config;
  const std::vector<std::string> after = {"nerf.preset=paper", "nerf.rays_per_step=512"};
  ASSERT_TRUE(FieldsOf(config).Set(after).ok());
  EXPECT_EQ(config.rays_per_step, 512);
  EXPECT_EQ(config.hidden_width, 64);
  const std::vector<std::string> back = {"nerf.preset=fast"};
  ASSERT_TRUE(FieldsOf(config).Set(back).ok());
  EXPECT_EQ(Dump(config), Dump(NerfConfig()));
  const std::vector<std::string> unknown = {"nerf.preset=slow"};
  EXPECT_FALSE(FieldsOf(config).Set(unknown).ok());
  EXPECT_EQ(config.preset, "fast");
}

}  // namespace romap::nerf::presets_test
