#include "client/bench/methods.h"

#include <algorithm>
#include <cctype>
#include <sstream>
#include <utility>

#include "common/config.h"

namespace romap::bench {
namespace {

// A plain MLP with frequency encoding and samples along the whole ray, with the learning rate of iMAP (Sucar et al.,
// ICCV 2021) and vMAP (Kong et al., CVPR 2023).
std::vector<std::string> FrequencyMlp(int hidden_width) {
  return {"nerf.encoding=frequency",      "nerf.levels=10",
          "nerf.hidden_layers=4",         fmt::format("nerf.hidden_width={}", hidden_width),
          "nerf.learning_rate=0.001",     "nerf.final_learning_rate=0.0002",
          "nerf.adam_beta1=0.9",          "nerf.adam_beta2=0.999",
          "nerf.carve_hull=false",        "nerf.hull_trim_share=0",
          "nerf.sampling=uniform",        "nerf.max_samples_per_ray=32",
          "nerf.density_weight=0",        "nerf.contrast_weight=0",
          "nerf.full_budget_steps=10000", "nerf.max_extra_steps=0"};
}

// The configuration of the paper, including its surface extraction with 64^3 nodes for all object sizes, then `more`.
std::vector<std::string> PaperSettings(const std::vector<std::string>& more) {
  std::vector<std::string> settings = {"nerf.preset=paper", "mesh.adapt_resolution=false", "mesh.resolution=64",
                                       "mesh.min_side_nodes=64"};
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

}  // namespace

absl::StatusOr<EngineConfig> Configure(const BenchMethod& method, const std::vector<std::string>& base) {
  EngineConfig config;
  ConfigFields fields;
  fields.Section("nerf");
  config.nerf.Fields(fields);
  fields.Section("mesh");
  config.mesh.Fields(fields);
  std::vector<std::string> assignments = base;
  assignments.insert(assignments.end(), method.settings.begin(), method.settings.end());
  ROMAP_RETURN_IF_ERROR(fields.Load("", assignments));
  return config;
}

std::vector<BenchMethod> Table1Methods() {
  return {
      {.id = "fast", .title = "ours, fast"},
      {.id = "trimmed", .title = "ours, fast, unseen surface removed", .settings = {"mesh.trim_unseen=true"}},
      {.id = "sdf", .title = "ours, signed distances", .settings = {"nerf.field=sdf"}},
      {.id = "paper", .title = "ours, the paper's configuration", .settings = PaperSettings({})},
      {.id = "offline", .title = "[33]*", .settings = PaperSettings({"nerf.density_weight=0"})},
      {.id = "offline-depth",
       .title = "[33]* with true depth",
       .settings = PaperSettings({"nerf.density_weight=0"}),
       .with_depth = true},
      {.id = "hull", .title = "visual hull, no training", .settings = {"nerf.hull_margin=0"}, .trained = false},
      {.id = "imap", .title = "iMAP-style MLP 4 x 256, with depth", .settings = FrequencyMlp(256), .with_depth = true},
      {.id = "vmap", .title = "vMAP-style MLP 4 x 32, with depth", .settings = FrequencyMlp(32), .with_depth = true},
  };
}

std::vector<BenchMethod> ModelSizeMethods() {
  std::vector<BenchMethod> methods;
  for (const auto& [log2_entries, layers] : {std::pair(14, 1), {16, 1}, {18, 1}, {20, 1}, {16, 2}, {16, 3}}) {
    methods.push_back(
        {.id = fmt::format("size-{}-{}", log2_entries, layers),
         .title = fmt::format("2^{} entries, {} hidden layer{}", log2_entries, layers, layers > 1 ? "s" : ""),
         .settings = {fmt::format("nerf.log2_table_entries={}", log2_entries),
                      fmt::format("nerf.hidden_layers={}", layers)}});
  }
  return methods;
}

std::vector<BenchMethod> AblationMethods() {
  return {
      {.id = "all-parts", .title = "all components"},
      {.id = "no-hull", .title = "no visual hull", .settings = {"nerf.carve_hull=false", "nerf.hull_trim_share=0"}},
      {.id = "no-opacity",
       .title = "no opacity loss",
       .settings = {"nerf.opacity_weight_object=0", "nerf.opacity_weight_background=0"}},
      {.id = "no-contrast", .title = "no contrast loss", .settings = {"nerf.contrast_weight=0"}},
      {.id = "no-density", .title = "no density loss", .settings = {"nerf.density_weight=0"}},
      {.id = "no-background", .title = "no background rays", .settings = {"nerf.background_share=0"}},
      {.id = "random-background",
       .title = "random background color (L_rr)",
       .settings = {"nerf.random_background=true"}},
      {.id = "uniform", .title = "uniform samples in the box", .settings = {"nerf.sampling=uniform"}},
      {.id = "all-pieces", .title = "floaters not removed", .settings = {"mesh.min_component_share=0"}},
      {.id = "open-unseen", .title = "unseen space not filled", .settings = {"mesh.fill_unseen=false"}},
      {.id = "half-width", .title = "16 neurons", .settings = {"nerf.hidden_width=16"}},
      {.id = "twice-rays", .title = "2048 rays per step", .settings = {"nerf.rays_per_step=2048"}},
      {.id = "with-depth", .title = "with true depth", .with_depth = true},
  };
}

absl::StatusOr<BenchMethod> ParseMethod(const std::string& text) {
  const auto colon = text.find(':');
  const std::string id = text.substr(0, colon);
  const bool good_id = !id.empty() && std::ranges::all_of(id, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-';
  });
  if (colon == std::string::npos || !good_id) {
    return InvalidArgument(
        "row '{}': expected 'NAME: nerf.field=value ..', where NAME has only letters, digits, - and _", text);
  }
  BenchMethod method{.id = id, .title = id};
  std::istringstream settings(text.substr(colon + 1));
  for (std::string setting; settings >> setting;) method.settings.push_back(setting);
  return method;
}

}  // namespace romap::bench
