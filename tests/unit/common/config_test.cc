#include "common/config.h"

#include <gmock/gmock.h>

#include <fstream>

#include "common/status.h"
#include "tests/support/subprocess.h"

namespace romap::config_test {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct Sample {
  int rays = 1024;
  int width = 32;
  double rate = 0.02;
  double final_rate = 0.002;
  bool enabled = true;
  std::string kind = "density";

  ConfigFields Fields() {
    ConfigFields fields;
    fields.Section("nerf");
    fields.Add("rays", &rays,
               {.unit = "rays", .min = 1, .max = 65536, .audience = Audience::kOperator, .help = "Rays per step"});
    fields.Add("width", &width, {.min = 16, .max = 256, .multiple_of = 16, .help = "Width of the layer"});
    fields.Add("rate", &rate, {.min = 0, .max = 1, .help = "Learning rate"});
    fields.Add("final_rate", &final_rate, {.min = 0, .max = 1, .help = "Learning rate at the end"});
    fields.Section("mesh");
    fields.Add("enabled", &enabled, {.help = "Make meshes"});
    fields.Add("kind", &kind, {.choices = {"density", "sdf"}, .help = "Field kind"});
    fields.AddRules([this](ConfigRules& rules) {
      rules.RequireAtMost(&final_rate, &rate);
      rules.Forbid(kind == "sdf" && !enabled, &kind, "needs", &enabled, "set it to true");
    });
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

TEST(ConfigTest, ErrorsInYamlNameTheLine) {
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

TEST(ConfigTest, ValuesThatAreNotAMultipleAreRejected) {
  Sample sample;
  const std::vector<std::string> assignments = {"nerf.width=40"};
  EXPECT_EQ(Message(sample.Fields().Set(assignments)), "--set nerf.width: 40 is not a multiple of 16");
  EXPECT_EQ(sample.width, 32);
}

TEST(ConfigTest, TextsWithControlCharactersOrBytesThatAreNotUtf8AreRejected) {
  Sample sample;
  for (const auto& [text, shown] : {std::pair<std::string, std::string>{"a\x80", "a\\x80"}, {"a\nb", "a\\nb"}}) {
    const std::vector<std::string> assignments = {"mesh.kind=" + text};
    EXPECT_EQ(Message(sample.Fields().Set(assignments)),
              "--set mesh.kind: '" + shown + "' has control characters or is not UTF-8");
  }
}

TEST(ConfigTest, FaultsOfValuesAndOfCombinationsAreReportedTogetherWithTheirOrigins) {
  const testing_support::TemporaryFolder folder;
  std::ofstream(folder / "a.yaml") << "nerf:\n  rate: 0.1\n  rays: 0\nmesh:\n  enabled: false\n";
  Sample sample;
  const std::vector<std::string> assignments = {"nerf.final_rate=0.2", "mesh.kind=sdf"};
  const absl::Status status = sample.Fields().Load(folder / "a.yaml", assignments);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  const std::string file = folder / "a.yaml";
  EXPECT_EQ(Message(status), file + ":3: nerf.rays: 0 is out of range (1 to 65536 rays); " +
                                 "--set: nerf.final_rate = 0.2 must not exceed nerf.rate = 0.1 (" + file + ":2); " +
                                 "--set: mesh.kind = sdf needs mesh.enabled = false (" + file + ":5); set it to true");
}

TEST(ConfigTest, OneSettingIsEnoughToViolateARule) {
  Sample sample;
  EXPECT_TRUE(sample.Fields().Validate().ok());
  ConfigFields fields = sample.Fields();
  ASSERT_TRUE(fields.LoadYaml("nerf:\n  rate: 0.001\n", "a.yaml").ok());
  EXPECT_EQ(Message(fields.Validate()), "a.yaml:2: nerf.final_rate = 0.002 must not exceed nerf.rate = 0.001");
}

TEST(ConfigTest, RulesDoNotApplyToInvalidSettings) {
  Sample sample;
  const std::vector<std::string> assignments = {"nerf.rate=fast", "nerf.final_rate=0.5"};
  EXPECT_EQ(Message(sample.Fields().Load("", assignments)), "--set nerf.rate: 'fast' is not a number");
}

TEST(ConfigTest, UnreadableFilesAreReportedWithTheSystemError) {
  const testing_support::TemporaryFolder folder;
  Sample sample;
  const absl::Status missing = sample.Fields().Load(folder / "a.yaml", {});
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Message(missing), (folder / "a.yaml") + ": cannot read: No such file or directory");
  EXPECT_EQ(sample.Fields().Load(folder / "", {}).code(), absl::StatusCode::kPermissionDenied) << "a folder";
}

TEST(ConfigTest, IgnoredSectionsAreNotChecked) {
  Sample sample;
  ConfigFields fields = sample.Fields();
  fields.IgnoreSection("transport");
  EXPECT_TRUE(fields.LoadYaml("transport:\n  port: 1\n", "a.yaml").ok());
  EXPECT_FALSE(fields.LoadYaml("transports:\n  port: 1\n", "a.yaml").ok());
}

TEST(ConfigTest, DumpForOperatorsHasOperatorSettingsAndExplicitlySetOnes) {
  Sample sample;
  EXPECT_EQ(sample.Fields().DumpYaml(Audience::kOperator),
            "nerf:\n  # Rays per step [rays, 1 to 65536]\n  rays: 1024\n");
  ConfigFields fields = sample.Fields();
  const std::vector<std::string> assignments = {"nerf.width=48"};
  ASSERT_TRUE(fields.Set(assignments).ok());
  EXPECT_EQ(fields.DumpYaml(Audience::kOperator),
            "nerf:\n  # Rays per step [rays, 1 to 65536]\n  rays: 1024\n"
            "  # Width of the layer [16 to 256, multiple of 16]\n  width: 48\n");
}

TEST(ConfigTest, LoadingTheDumpGivesTheSameValues) {
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

}  // namespace romap::config_test
