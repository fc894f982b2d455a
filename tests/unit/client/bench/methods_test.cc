#include "client/bench/methods.h"

#include <gmock/gmock.h>

#include <set>

#include "client/bench/published.h"

namespace romap::bench::methods_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<BenchMethod> AllMethods() {
  std::vector<BenchMethod> all = Table1Methods();
  for (const auto& methods : {ModelSizeMethods(), AblationMethods()}) {
    all.insert(all.end(), methods.begin(), methods.end());
  }
  return all;
}

EngineConfig ConfigOf(const std::string& id, const std::vector<std::string>& base = {}) {
  for (const BenchMethod& method : AllMethods()) {
    if (method.id != id) continue;
    const absl::StatusOr<EngineConfig> config = Configure(method, base);
    EXPECT_TRUE(config.ok()) << id << ": " << Message(config.status());
    return config.value_or(EngineConfig());
  }
  ADD_FAILURE() << "no method " << id;
  return {};
}

std::string Dump(EngineConfig config) {
  ConfigFields fields;
  config.nerf.Fields(fields);
  config.mesh.Fields(fields);
  return fields.DumpYaml();
}

TEST(MethodsTest, EveryMethodHasValidSettings) {
  std::set<std::string> ids;
  for (const BenchMethod& method : AllMethods()) {
    EXPECT_TRUE(ids.insert(method.id).second) << method.id << " exists twice";
    EXPECT_TRUE(Configure(method, {}).ok()) << method.id << ": " << Message(Configure(method, {}).status());
  }
}

// An ablation must differ from the default.
TEST(MethodsTest, EveryAblationChangesSomething) {
  const std::string defaults = Dump(EngineConfig());
  for (const BenchMethod& method : AblationMethods()) {
    const bool same = Dump(ConfigOf(method.id)) == defaults && !method.with_depth;
    EXPECT_EQ(same, method.id == "all-parts") << method.id;
  }
}

// [33] as reimplemented in the paper: the same model without the density loss.
TEST(MethodsTest, OfflineMethodDiffersOnlyInTheDensityLoss) {
  EngineConfig offline = ConfigOf("offline");
  EXPECT_EQ(offline.nerf.density_weight, 0);
  EXPECT_TRUE(offline.nerf.random_background);
  offline.nerf.density_weight = ConfigOf("paper").nerf.density_weight;
  EXPECT_EQ(Dump(offline), Dump(ConfigOf("paper")));
  EXPECT_EQ(Dump(ConfigOf("offline-depth")), Dump(ConfigOf("offline")));
}

TEST(MethodsTest, OnlyTheNamedMethodsUseDepth) {
  std::vector<std::string> with_depth, untrained;
  for (const BenchMethod& method : Table1Methods()) {
    if (method.with_depth) with_depth.push_back(method.id);
    if (!method.trained) untrained.push_back(method.id);
  }
  EXPECT_THAT(with_depth, ElementsAre("offline-depth", "imap", "vmap"));
  EXPECT_THAT(untrained, ElementsAre("hull"));
  for (const char* id : {"offline-depth", "imap", "vmap"}) EXPECT_GT(ConfigOf(id).nerf.depth_weight, 0) << id;
}

TEST(MethodsTest, PlainMlpsHaveTheirPublishedSizes) {
  for (const auto& [id, width] : {std::pair("imap", 256), {"vmap", 32}}) {
    const nerf::NerfConfig nerf = ConfigOf(id).nerf;
    EXPECT_EQ(nerf.encoding, "frequency");
    EXPECT_EQ(nerf.hidden_width, width);
    EXPECT_EQ(nerf.hidden_layers, 4);
    EXPECT_FALSE(nerf.carve_hull);
  }
}

TEST(MethodsTest, ModelSizesMatchTheTableOfThePaper) {
  const std::vector<BenchMethod> methods = ModelSizeMethods();
  ASSERT_EQ(methods.size(), std::size(kPublishedTable4));
  for (size_t i = 0; i < methods.size(); ++i) {
    const nerf::NerfConfig nerf = ConfigOf(methods[i].id).nerf;
    EXPECT_EQ(nerf.log2_table_entries, kPublishedTable4[i].log2_table_entries);
    EXPECT_EQ(nerf.hidden_layers, kPublishedTable4[i].hidden_layers);
  }
}

TEST(MethodsTest, MethodSettingsOverrideCommonSettings) {
  EXPECT_EQ(ConfigOf("fast", {"nerf.hidden_width=48"}).nerf.hidden_width, 48);
  EXPECT_EQ(ConfigOf("vmap", {"nerf.hidden_width=48"}).nerf.hidden_width, 32);
  EXPECT_EQ(ConfigOf("fast", {"mesh.resolution=60"}).mesh.resolution, 60);
  EXPECT_THAT(Message(Configure(BenchMethod(), {"nerf.hiden_width=48"}).status()), HasSubstr("nerf.hidden_width"));
  EXPECT_EQ(Message(Configure(BenchMethod{.id = "m", .title = "m", .settings = {"mesh.resolution=32"}},
                              {"mesh.min_side_nodes=40"})
                        .status()),
            "--set: mesh.min_side_nodes = 40 must not exceed mesh.resolution = 32");
}

TEST(MethodsTest, ParsesRows) {
  const absl::StatusOr<BenchMethod> row = ParseMethod("big-one: nerf.levels=12  nerf.hidden_width=64");
  ASSERT_TRUE(row.ok());
  EXPECT_EQ(row->id, "big-one");
  EXPECT_THAT(row->settings, ElementsAre("nerf.levels=12", "nerf.hidden_width=64"));
  EXPECT_THAT(ParseMethod("plain:")->settings, IsEmpty());
  for (const char* bad : {"no colon", ": nerf.levels=12", "../up: nerf.levels=12", "two words: nerf.levels=2"}) {
    EXPECT_THAT(Message(ParseMethod(bad).status()), HasSubstr("NAME: nerf.field=value")) << bad;
  }
}

}  // namespace romap::bench::methods_test
