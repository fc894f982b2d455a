#include "common/config.h"

#include <gmock/gmock.h>

#include "common/status.h"

namespace romap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct Sample {
  int rays = 1024;
  double rate = 0.02;
  bool enabled = true;
  std::string kind = "density";

  ConfigFields Fields() {
    ConfigFields fields;
    fields.Section("nerf");
    fields.Add("rays", &rays, {.unit = "rays", .min = 1, .max = 65536, .help = "Rays per step"});
    fields.Add("rate", &rate, {.min = 0, .max = 1, .help = "Learning rate"});
    fields.Section("mesh");
    fields.Add("enabled", &enabled, {.help = "Make meshes"});
    fields.Add("kind", &kind, {.choices = {"density", "sdf"}, .help = "Field kind"});
    return fields;
  }
};

TEST(ConfigTest, YamlSetsFieldsAndLeavesOthers) {
  Sample sample;
  ASSERT_TRUE(sample.Fields().LoadYaml("nerf:\n  rays: 2048\nmesh:\n  enabled: false\n  kind: sdf\n", "a.yaml").ok());
  EXPECT_EQ(sample.rays, 2048);
  EXPECT_EQ(sample.rate, 0.02);
  EXPECT_FALSE(sample.enabled);
  EXPECT_EQ(sample.kind, "sdf");
}

TEST(ConfigTest, AllFaultsAreReportedTogetherWithLines) {
  Sample sample;
  const absl::Status status = sample.Fields().LoadYaml(
      "nerf:\n  rayz: 12\n  rays: 99999999\n  rate: fast\nmesh:\n  kind: voxel\n  enabled: maybe\n", "a.yaml");
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(Message(status), AllOf(HasSubstr("a.yaml:2: unknown key 'nerf.rayz', did you mean 'nerf.rays'?"),
                                     HasSubstr("a.yaml:3: nerf.rays: 99999999 is out of range (1 to 65536 rays)"),
                                     HasSubstr("a.yaml:4: nerf.rate: 'fast' is not a number"),
                                     HasSubstr("a.yaml:6: mesh.kind: 'voxel' is not one of density, sdf"),
                                     HasSubstr("a.yaml:7: mesh.enabled: 'maybe' is neither true nor false")));
}

TEST(ConfigTest, NotANumberIsOutOfRange) {
  Sample sample;
  EXPECT_FALSE(sample.Fields().LoadYaml("nerf:\n  rate: .nan\n", "a.yaml").ok());
  EXPECT_EQ(sample.rate, 0.02);
}

TEST(ConfigTest, BrokenYamlNamesTheLine) {
  Sample sample;
  EXPECT_THAT(Message(sample.Fields().LoadYaml("nerf:\n  rays: [1\n", "a.yaml")), HasSubstr("a.yaml:"));
  EXPECT_THAT(Message(sample.Fields().LoadYaml("- 1\n- 2\n", "a.yaml")), HasSubstr("sections"));
}

TEST(ConfigTest, SetAppliesAssignments) {
  Sample sample;
  const std::vector<std::string> good = {"nerf.rays=64", "mesh.kind=sdf"};
  ASSERT_TRUE(sample.Fields().Set(good).ok());
  EXPECT_EQ(sample.rays, 64);
  EXPECT_EQ(sample.kind, "sdf");
  const std::vector<std::string> bad = {"nerf.ray=64", "mesh.kind"};
  EXPECT_THAT(Message(sample.Fields().Set(bad)),
              AllOf(HasSubstr("did you mean 'nerf.rays'"), HasSubstr("expected section.field=value")));
}

TEST(ConfigTest, DumpReadsBackToTheSameValues) {
  Sample sample;
  sample.rays = 77;
  sample.kind = "sdf";
  const std::string dump = sample.Fields().DumpYaml();
  EXPECT_THAT(dump, HasSubstr("# Rays per step [rays, 1 to 65536]"));
  Sample other;
  ASSERT_TRUE(other.Fields().LoadYaml(dump, "dump").ok());
  EXPECT_EQ(other.rays, 77);
  EXPECT_EQ(other.kind, "sdf");
}

}  // namespace
}  // namespace romap
